#!/usr/bin/python3
"""evaluate_registration: where nothing is open a wrong start is forgotten, along a tunnel without intensity it stays.

usage: test_registration_error.py BIN_DIR SOURCE_DIR
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

BIN = pathlib.Path()
SOURCE = pathlib.Path()


class RegistrationError(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = pathlib.Path(folder.name)

    def simulate(self, scenario, duration_s=8, seed=1):
        subprocess.run([BIN / "simulate_bag", "--scenario", SOURCE / f"config/scenarios/{scenario}.yaml", "--seed",
                        str(seed), "--set", "lidar.model=vlp16", "--output", self.path / "a.bag", "--duration",
                        str(duration_s)], check=True, capture_output=True)

    def evaluate(self, *options):
        return subprocess.run([BIN / "evaluate_registration", "--config", self.path / "a.config.yaml", "--bag",
                               self.path / "a.bag", "--output", self.path / "a.csv", *options], capture_output=True,
                              text=True, check=False)

    def rows(self, *options):
        done = self.evaluate(*options)
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = np.loadtxt(self.path / "a.csv", delimiter=",", skiprows=1)
        self.assertGreaterEqual(len(rows), 15)  # every fifth of 80 scans
        self.assertTrue(np.isfinite(rows).all())
        return rows

    def test_a_square_leaves_nothing_open(self):
        self.simulate("plaza")
        rows = self.rows()
        self.assertLess(np.median(rows[:, 1]), 0.01)
        self.assertLess(np.median(rows[:, 2]), 0.01)

    def test_a_tunnel_leaves_its_axis_to_the_intensity(self):
        # Which marks lie along eleven seconds of one tunnel is chance: three of them.
        parts = []
        for seed in (1, 2, 3):
            self.simulate("tunnel", 18, seed)
            parts.append(self.rows("--start", "7"))
        rows = np.vstack(parts)
        # What stays of starts 0.2 m beside the truth along three axes is up to sqrt((0.2 m)^2 / 3) = 0.115 m.
        blind = np.median(rows[:, 2])
        self.assertGreater(blind, 0.05)
        self.assertLess(np.median(rows[:, 1]), 0.4 * blind)
        # The vehicle drives along the tunnel, x of its IMU ahead.
        is_open = rows[:, 2] > 0.05
        self.assertGreater(np.median(np.abs(rows[is_open, 3])), np.cos(np.radians(5)))

    def test_a_recording_without_truth(self):
        self.simulate("plaza")
        (self.path / "a.tum").unlink()
        done = self.evaluate()
        self.assertEqual(done.returncode, 2)
        self.assertIn("a.tum", done.stderr)
        self.assertIn("simulate_bag", done.stderr)

    def test_what_the_run_reports_is_shown(self):
        self.simulate("plaza", 4)
        done = self.evaluate("--set", "sensor.points_topic=/none")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("/none", done.stderr)
        done = self.evaluate("--start", "100")
        self.assertEqual(done.returncode, 2)
        self.assertIn("no scan", done.stderr)

    def test_a_recording_without_its_calibration(self):
        self.simulate("plaza")
        (self.path / "a.yaml").write_text("seed: 1\n")
        done = self.evaluate()
        self.assertEqual(done.returncode, 2)
        self.assertIn("a.yaml", done.stderr)


if __name__ == "__main__":
    BIN, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
