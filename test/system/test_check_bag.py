#!/usr/bin/python3
"""check_bag, and the check that offline_slam makes before it starts, on a simulated street.

usage: test_check_bag.py BIN_DIR SOURCE_DIR
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

BIN = pathlib.Path()
SOURCE = pathlib.Path()


class CheckBag(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        cls.bag = cls.path / "street.bag"
        subprocess.run(
            [BIN / "simulate_bag", "--scenario", SOURCE / "config/scenarios/street.yaml", "--seed", "7", "--output",
             cls.bag, "--duration", "5", "--set", "lidar.model=vlp16"], check=True, capture_output=True)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def run_tool(self, name, *arguments, bag=None):
        return subprocess.run(
            [BIN / name, "--config", self.path / "street.config.yaml", "--bag", bag or self.bag, *arguments],
            capture_output=True, text=True, check=False)

    def check(self, *overrides, bag=None):
        settings = [word for override in overrides for word in ("--set", override)]
        return self.run_tool("check_bag", *settings, bag=bag)

    def test_a_recording_that_fits(self):
        done = self.check()
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertRegex(done.stdout, r"/points_raw +sensor_msgs/PointCloud2 +50 +1\d\.\d")
        self.assertRegex(done.stdout, r"/imu_raw +sensor_msgs/Imu +\d+ +\d+\.\d")
        self.assertIn("ring 'ring', time 'time' in s", done.stdout)
        self.assertIn("verdict: the recording fits", done.stdout)

    def test_warnings_give_one(self):
        for override, text in (("sensor.ring_count=64", "16 rings"),
                               ("sensor.scan_period=0.05", "set sensor.scan_period to 0.100"),
                               ("sensor.imu_topic=/none", "'/none'"),
                               ("sensor.T_imu_lidar.rotation=[0.259,0,0,0.966]", "is tilted by "),
                               ("sensor.lidar_time_offset=2.0", "sensor.lidar_time_offset")):
            done = self.check(override)
            self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
            self.assertIn(text, done.stdout)
            self.assertIn("verdict: ", done.stdout)

    def test_errors_give_two(self):
        for override, text in (("sensor.acceleration_unit=g", "set sensor.acceleration_unit to m/s^2"),
                               ("sensor.lidar_time_offset=9.0", "no time in common")):
            done = self.check(override)
            self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
            self.assertIn(text, done.stdout)
            self.assertRegex(done.stdout, r"verdict: \d error")

    def test_what_cannot_be_read_is_named(self):
        done = self.check(bag=self.path / "missing.bag")
        self.assertEqual(done.returncode, 2)
        self.assertIn("missing.bag", done.stderr)
        done = self.run_tool("check_bag", "--output", "x")
        self.assertEqual(done.returncode, 2)
        self.assertIn("unknown argument '--output'", done.stderr)

    def test_a_run_refuses_errors_unless_told_otherwise(self):
        wrong = ("--output", self.path / "run", "--set", "sensor.acceleration_unit=g")
        done = self.run_tool("offline_slam", *wrong)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("set sensor.acceleration_unit to m/s^2", done.stderr)
        self.assertIn("check.enabled=false", done.stderr)
        self.assertFalse((self.path / "run").exists())
        done = self.run_tool("offline_slam", *wrong, "--set", "check.enabled=false")
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_a_run_warns_and_keeps_the_warning(self):
        done = self.run_tool("offline_slam", "--output", self.path / "warned", "--set", "sensor.ring_count=64")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("sensor.ring_count is 64", done.stderr)
        self.assertIn("sensor.ring_count is 64", (self.path / "warned/warnings.txt").read_text())


if __name__ == "__main__":
    SOURCE = pathlib.Path(sys.argv.pop()).resolve()
    BIN = pathlib.Path(sys.argv.pop()).resolve()
    unittest.main(verbosity=2)
