#!/usr/bin/python3
"""Sessions of simulated drives: localised in by another drive, not by one elsewhere, and merged.

usage: test_localisation.py BIN_DIR SOURCE_DIR
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np
from test_offline_slam import read_tum

BIN = pathlib.Path()
SOURCE = pathlib.Path()
REVISIT_S = 18


class Localisation(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        cls.simulate("first", 7, "--duration", "24")
        # Another drive back, with other sensor errors, and a drive in another town.
        cls.simulate("back", 7, "--duration", "16", "--revisit", str(REVISIT_S), "--reversed", "yes", "--noise-seed", "9")
        cls.simulate("elsewhere", 8, "--duration", "12")
        for name in ("first", "back"):
            done = cls.run_slam(name, name, "--set", "loop.save_session=true")
            assert done.returncode == 0, done.stderr

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def simulate(cls, name, seed, *arguments):
        subprocess.run(
            [BIN / "simulate_bag", "--scenario", SOURCE / "config/scenarios/street.yaml", "--seed", str(seed), "--output",
             cls.path / f"{name}.bag", "--set", "lidar.model=vlp16", "--set", "motion.speed=6", *arguments],
            check=True, capture_output=True)

    @classmethod
    def run_slam(cls, name, bag, *arguments):
        return subprocess.run(
            [BIN / "offline_slam", "--config", cls.path / "first.config.yaml", "--bag", cls.path / f"{bag}.bag",
             "--output", cls.path / name, *arguments], capture_output=True, text=True, check=False)

    def truth(self, name, stamps):
        truth = read_tum(self.path / f"{name}.tum")
        return np.stack([np.interp(stamps, truth[:, 0], truth[:, k]) for k in (1, 2, 3)], axis=1)

    def errors(self, poses, name):
        """Of poses in the map of `first`, which is put where that drive really was."""
        made = read_tum(self.path / "first/trajectory.tum")
        p, q = made[:, 1:4], self.truth("first", made[:, 0])
        u, _, vt = np.linalg.svd((q - q.mean(axis=0)).T @ (p - p.mean(axis=0)))
        rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
        moved = (poses[:, 1:4] - p.mean(axis=0)) @ rotation.T + q.mean(axis=0)
        return np.linalg.norm(moved - self.truth(name, poses[:, 0]), axis=1)

    def test_the_other_drive_begins_where_the_first_was_and_looks_back(self):
        first, back = read_tum(self.path / "first.tum"), read_tum(self.path / "back.tum")
        there = first[np.searchsorted(first[:, 0], first[0, 0] + REVISIT_S)]
        np.testing.assert_allclose(back[0, 1:4], there[1:4], atol=0.15)
        # Half a turn about the vertical axis: (x, y, z, w) becomes (y, -x, w, -z) or its negative.
        self.assertGreater(abs(np.dot(back[0, 4:], [there[5], -there[4], there[7], -there[6]])), 0.9999)
        self.assertLess(np.linalg.norm(back[100, 1:4] - back[0, 1:4]), 0.01)

    def localise(self, name, bag, *arguments):
        done = self.run_slam(name, bag, "--localise", self.path / "first/session", *arguments)
        return done, self.path / name

    def test_a_drive_back_is_found_in_the_session(self):
        done, output = self.localise("found", "back")
        self.assertEqual(done.returncode, 0, done.stderr)
        poses = read_tum(output / "trajectory.tum")
        self.assertLess(poses[0, 0] - read_tum(output / "odometry.tum")[0, 0], 10.0)
        self.assertLess(self.errors(poses, "back").max(), 0.3)
        self.assertFalse((output / "map.pcd").exists())
        self.assertIn("tracking,accepted", (output / "localisation.csv").read_text(encoding="utf-8"))
        again, _ = self.localise("again", "back", "--set", "threads=1")
        self.assertEqual(again.returncode, 0)
        for file in ("trajectory.tum", "localisation.csv"):
            self.assertEqual((output / file).read_bytes(), (self.path / "again" / file).read_bytes(), file)

    def test_a_drive_elsewhere_is_not(self):
        done, output = self.localise("elsewhere", "elsewhere")
        self.assertEqual(done.returncode, 2)
        self.assertIn("was not found in the session", done.stderr)
        self.assertEqual(read_tum(output / "odometry.tum").shape[1], 8)

    def test_bad_options_are_named(self):
        done, _ = self.localise("pose", "back", "--initial-pose", "1 2")
        self.assertEqual(done.returncode, 2)
        self.assertIn("x y yaw", done.stderr)
        done = self.run_slam("none", "back", "--localise", self.path)
        self.assertIn("no session.yaml", done.stderr)
        done = self.run_slam("none", "back", "--initial-pose", "1 2 3")
        self.assertIn("--localise", done.stderr)

    def merge(self, first, second, output):
        return subprocess.run(
            [BIN / "optimise_session", "--config", self.path / "first.config.yaml", "--session", first, "--merge", second,
             "--output", output], capture_output=True, text=True, check=False)

    def test_two_sessions_become_one(self):
        first, back, merged = (self.path / name for name in ("first/session", "back/session", "merged"))
        done = self.merge(first, back, merged)
        self.assertEqual(done.returncode, 0, done.stderr)
        counts = [len(read_tum(path / "trajectory.tum")) for path in (first, back, merged)]
        self.assertEqual(counts[0] + counts[1], counts[2])
        poses = read_tum(merged / "trajectory.tum")
        self.assertLess(self.errors(poses[:counts[0]], "first").max(), 0.3)
        self.assertLess(self.errors(poses[counts[0]:], "back").max(), 0.4)
        self.assertIn("accepted", (merged / "loops.csv").read_text(encoding="utf-8"))


if __name__ == "__main__":
    SOURCE = pathlib.Path(sys.argv.pop()).resolve()
    BIN = pathlib.Path(sys.argv.pop()).resolve()
    unittest.main(verbosity=2)
