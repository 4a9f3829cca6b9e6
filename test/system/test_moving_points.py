#!/usr/bin/python3
"""evaluate_moving_points: what it counts agrees with the labels, with the filter off and on, and bad input is named.

usage: test_moving_points.py BIN_DIR SOURCE_DIR
"""
import json
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

import numpy as np

BIN = pathlib.Path()
SOURCE = pathlib.Path()
NO_FILTER = ("--set", "dynamic.mode=off", "--set", "isolation.min_neighbours=0")


def labels_of(path):
    """Labels of all points of all scans."""
    content = path.read_bytes()
    parts = []
    at = 0
    while at < len(content):
        _, count = struct.unpack_from("<qI", content, at)
        at += 12
        parts.append(np.frombuffer(content, "<i2", count, at))
        at += 2 * count
    return np.concatenate(parts)


class MovingPoints(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        cls.simulate("a", "--duration", "12")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def simulate(cls, name, *options):
        subprocess.run([BIN / "simulate_bag", "--scenario", SOURCE / "config/scenarios/plaza.yaml", "--seed", "1",
                        "--set", "lidar.model=vlp16", "--output", cls.path / f"{name}.bag", *options], check=True,
                       capture_output=True)

    def evaluate(self, name, *options):
        return subprocess.run([BIN / "evaluate_moving_points", "--config", self.path / f"{name}.config.yaml", "--bag",
                               self.path / f"{name}.bag", *options], capture_output=True, text=True, check=False)

    def result(self, name, *options):
        done = self.evaluate(name, *options)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)

    def test_without_a_filter_all_points_are_counted_and_none_is_removed(self):
        result = self.result("a", *NO_FILTER)
        labels = labels_of(self.path / "a.labels")
        moving = np.count_nonzero(labels > 0)
        self.assertGreater(moving, 1000)
        # The reader drops what is nearer than the least range, and the first scan has no IMU before it.
        self.assertLessEqual(result["moving_points"], moving)
        self.assertGreater(result["moving_points"], 0.95 * moving)
        self.assertLessEqual(result["static_points"], len(labels) - moving)
        self.assertGreater(result["static_points"], 0.95 * (len(labels) - moving))
        self.assertEqual(result["moving_removed"], 0.0)
        self.assertEqual(result["static_kept"], 1.0)
        self.assertEqual(result["reasons"], {})
        self.assertEqual(sum(ring["moving_points"] for ring in result["by_range"]), result["moving_points"])
        self.assertGreater(result["ghost_voxels_of_scans"], 0.0)

    def test_the_filter_takes_what_moves(self):
        without = self.result("a", *NO_FILTER)
        result = self.result("a")
        for key in ("moving_points", "static_points"):
            self.assertEqual(result[key], without[key])
        self.assertGreater(result["moving_removed"], 0.5)
        self.assertGreater(result["static_kept"], 0.95)
        self.assertLess(result["ghost_voxels_of_scans"], 0.5 * without["ghost_voxels_of_scans"])
        self.assertLessEqual(result["ghost_voxels"], result["ghost_voxels_of_scans"])
        # Reasons and shares are of the same points.
        for kind, share in (("moving", result["moving_removed"]), ("static", 1.0 - result["static_kept"])):
            removed = sum(counts[kind] for counts in result["reasons"].values())
            self.assertAlmostEqual(removed / result[f"{kind}_points"], share, places=4)

    def test_where_nothing_moves_there_are_no_ghosts(self):
        self.simulate("empty", "--duration", "4", "--set", "world.walkers=0", "--set", "world.cars=0")
        result = self.result("empty")
        self.assertEqual(result["moving_points"], 0)
        self.assertEqual(result["moving_removed"], 1.0)
        self.assertEqual(result["ghost_voxels"], 0.0)
        self.assertGreater(result["static_kept"], 0.95)

    def test_labels_of_another_recording(self):
        self.simulate("other", "--duration", "4", "--set", "world.walkers=3")
        (self.path / "other.labels").write_bytes((self.path / "a.labels").read_bytes()[:1000])
        done = self.evaluate("other")
        self.assertEqual(done.returncode, 2)
        self.assertIn("labels", done.stderr)
        (self.path / "other.labels").unlink()
        done = self.evaluate("other")
        self.assertEqual(done.returncode, 2)
        self.assertIn("other.labels", done.stderr)
        self.assertIn("simulate_bag", done.stderr)

    def test_a_topic_that_is_not_there(self):
        done = self.evaluate("a", "--set", "sensor.points_topic=/none", "--duration", "2")
        self.assertEqual(done.returncode, 0)
        self.assertIn("warning", done.stderr)
        self.assertIn("/none", done.stderr)
        self.assertGreater(json.loads(done.stdout)["static_points"], 0)

    def test_nothing_to_read(self):
        done = self.evaluate("a", "--start", "100")
        self.assertEqual(done.returncode, 2)
        self.assertIn("no scan", done.stderr)
        (self.path / "b.config.yaml").write_text((self.path / "a.config.yaml").read_text())
        done = self.evaluate("b")
        self.assertEqual(done.returncode, 2)
        self.assertIn("b.bag", done.stderr)


if __name__ == "__main__":
    BIN, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
