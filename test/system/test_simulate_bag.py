#!/usr/bin/python3
"""simulate_bag asked for what it cannot do: one message, exit code 2, and no file left behind.

usage: test_simulate_bag.py BIN_DIR SOURCE_DIR
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

BIN = pathlib.Path()
SOURCE = pathlib.Path()


class BadInput(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.folder.name)
        self.addCleanup(self.folder.cleanup)

    def simulate(self, *arguments, scenario=None, output=None):
        return subprocess.run(
            [BIN / "simulate_bag", "--scenario", scenario or SOURCE / "config/scenarios/corridor.yaml", "--output",
             output or self.path / "x.bag", *arguments], capture_output=True, text=True, check=False, timeout=120)

    def expect_refusal(self, done, *texts):
        self.assertEqual(done.returncode, 2, done.stderr)
        for text in texts:
            self.assertIn(text, done.stderr)
        self.assertEqual(list(self.path.iterdir()), [])

    def test_scenario(self):
        self.expect_refusal(self.simulate(scenario="config/scenarios/moon.yaml"), "unknown scenario", "moon")

    def test_sensor_and_keys(self):
        self.expect_refusal(self.simulate("--set", "lidar.model=sick", "--set", "world.cats=1"), "sick", "world.cats")

    def test_seed(self):
        for seed in ("-1", "2147483648", "1.5", "one", ""):
            self.expect_refusal(self.simulate("--seed", seed), "--seed")

    def test_duration(self):
        for duration in ("0", "-3", "1e9", "nan", "long"):
            self.expect_refusal(self.simulate("--duration", duration), "duration")

    def test_output_that_cannot_be_written(self):
        for output in (self.path / "no/such/x.bag", "/proc/x.bag"):
            self.expect_refusal(self.simulate("--duration", "1", output=output), str(output.parent if isinstance(
                output, pathlib.Path) else "/proc"))

    def test_full_disk(self):
        if os.geteuid() != 0:
            self.skipTest("needs root, for a small file system")
        with tempfile.TemporaryDirectory() as disk:
            if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", disk], capture_output=True).returncode:
                self.skipTest("this machine lets nobody mount")
            try:
                done = self.simulate("--duration", "5", output=pathlib.Path(disk) / "x.bag")
                left = os.listdir(disk)
            finally:
                subprocess.run(["umount", disk], check=True)
        self.expect_refusal(done, disk, "space")
        self.assertEqual(left, [])


if __name__ == "__main__":
    SOURCE = pathlib.Path(sys.argv.pop()).resolve()
    BIN = pathlib.Path(sys.argv.pop()).resolve()
    unittest.main(verbosity=2)
