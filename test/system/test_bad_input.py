#!/usr/bin/python3
"""offline_slam on recordings that are broken in one way each: it runs or refuses, names the fault, never crashes.

usage: test_bad_input.py BIN_DIR SOURCE_DIR
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import broken_bags as bags
import numpy as np
from broken_bags import IMU, POINTS
from test_offline_slam import ate_rmse, read_tum

BIN = pathlib.Path()
SOURCE = pathlib.Path()
SCANS = 60
HOUR_S = 3600.0
NAN = float("nan")
AT_ORIGIN = {"x": 0.0, "y": 0.0, "z": 0.0}


class BadInput(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        cls.good = cls.path / "good.bag"
        subprocess.run(
            [BIN / "simulate_bag", "--scenario", SOURCE / "config/scenarios/street.yaml", "--seed", "7", "--output",
             cls.good, "--duration", str(SCANS // 10), "--set", "lidar.model=vlp16"], check=True, capture_output=True)
        cls.truth = read_tum(cls.path / "good.tum")
        cls.broken = cls.path / "broken.bag"
        cls.output = cls.path / "run"

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def run_slam(self, *arguments, bag=None, output=None):
        return subprocess.run(
            [BIN / "offline_slam", "--config", self.path / "good.config.yaml", "--bag", bag or self.broken, "--output",
             output or self.output, *arguments], capture_output=True, text=True, check=False, timeout=120)

    def expect_run(self, change, *texts, scans=SCANS, max_error_m=0.1, arguments=(), parts=("run",)):
        """The run ends well: `scans` poses in all `parts`, as good as asked, and each of `texts` in the messages."""
        bags.rewrite(self.good, self.broken, change)
        done = self.run_slam(*arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        for text in texts:
            self.assertIn(text, done.stderr)
        poses = [read_tum(self.path / part / "trajectory.tum") for part in parts]
        self.assertEqual(sum(len(part) for part in poses), scans)
        for part in poses:
            self.assertTrue(np.isfinite(part).all())
            self.assertTrue((np.diff(part[:, 0]) > 0).all())
            self.assertLess(np.abs(part[:, 1:4]).max(), 200.0)
        self.assertLess(ate_rmse(poses[0], self.truth), max_error_m)
        return poses[0]

    def expect_refusal(self, change, *texts, arguments=()):
        bags.rewrite(self.good, self.broken, change)
        done = self.run_slam(*arguments)
        self.assertEqual(done.returncode, 2, done.stderr)
        for text in texts:
            self.assertIn(text, done.stderr)


class Clouds(BadInput):
    def test_without_time(self):
        self.expect_run(bags.without_field("time"), "guessed from the azimuth", "sensor.deskew")

    def test_without_ring(self):
        self.expect_run(bags.without_field("ring"), "ring from the elevation")

    def test_without_intensity(self):
        self.expect_run(bags.without_field("intensity"), "intensity absent")

    def test_empty(self):
        self.expect_run(bags.emptied(5), "has no points", scans=48)
        self.expect_refusal(bags.emptied(1), "has no points", "no scan of the recording could be used")

    def test_all_nan(self):
        self.expect_run(bags.every_point({"x": NAN}, every=5), "not finite", scans=48)
        self.expect_refusal(bags.every_point({"x": NAN}), "not finite", "no scan of the recording could be used")

    def test_all_at_origin(self):
        self.expect_run(bags.every_point(AT_ORIGIN, every=5), "at the origin", scans=48)
        self.expect_refusal(bags.every_point(AT_ORIGIN), "at the origin", "no scan of the recording could be used")

    def test_times_that_are_none(self):
        self.expect_run(bags.every_point({"time": 0.0}), "same time", max_error_m=0.5)
        self.expect_run(bags.every_point({"time": NAN}, every=5), "not finite", scans=48)

    def test_impossible_rings(self):
        self.expect_run(bags.every_point({"ring": 5000}, every=5), "1024 rings", scans=48)

    def test_layouts_that_hold_the_same_points_give_the_same_poses(self):
        expected = self.expect_run(bags.clouds(lambda *_: None))
        np.testing.assert_array_equal(self.expect_run(bags.clouds(bags.doubled_points)), expected)
        np.testing.assert_array_equal(self.expect_run(bags.clouds(bags.odd_step)), expected)

    def test_wrong_point_step(self):
        self.expect_refusal(bags.clouds(lambda _, cloud: setattr(cloud, "point_step", 21)), "point_step", "'time'")

    def test_scans_dropped_for_two_seconds(self):
        self.expect_run(bags.for_topic(POINTS, lambda i, *rest: [] if 20 <= i < 40 else [rest]), scans=40)


class Stamps(BadInput):
    def test_backwards(self):
        self.expect_run(bags.for_topic(POINTS, bags.neighbours_swapped(7)), "out of order", "does not follow",
                        scans=51)

    def test_repeated(self):
        self.expect_run(bags.for_topic(POINTS, lambda _, *rest: [rest, rest]), "repeated", "does not follow")

    def test_one_scan_an_hour_away(self):
        for jump_s in (HOUR_S, -HOUR_S):
            self.expect_run(bags.for_topic(POINTS, bags.shift_stamps(lambda i, s=jump_s: s * (i == 30))),
                            "does not follow", scans=SCANS - 1)

    def test_one_reading_an_hour_away(self):
        for jump_s in (HOUR_S, -HOUR_S):
            self.expect_run(bags.for_topic(IMU, bags.shift_stamps(lambda i, s=jump_s: s * (i == 300))),
                            "far from the others")

    def test_both_clocks_jump_by_an_hour(self):
        for jump_s in (HOUR_S, -HOUR_S):
            change = bags.all_of(bags.for_topic(POINTS, bags.shift_stamps(lambda i, s=jump_s: s * (i >= 30))),
                                 bags.for_topic(IMU, bags.shift_stamps(lambda i, s=jump_s: s * (i >= 300))))
            self.expect_run(change, "starting anew", "run_2", scans=SCANS - 1, parts=("run", "run_2"))

    def test_one_clock_jumps_by_an_hour(self):
        self.expect_run(bags.for_topic(POINTS, bags.shift_stamps(lambda i: HOUR_S * (i >= 30))), "starting anew",
                        "no IMU data", scans=SCANS - 1, parts=("run", "run_2"))
        self.expect_run(bags.for_topic(IMU, bags.shift_stamps(lambda i: HOUR_S * (i >= 300))), "no IMU data")

    def test_clocks_that_never_agree(self):
        self.expect_refusal(bags.for_topic(IMU, bags.shift_stamps(lambda _: 100.0)), "no time in common", "100.0",
                            "sensor.lidar_time_offset")


class Imu(BadInput):
    def test_silent_for_a_second(self):
        self.expect_run(bags.for_topic(IMU, lambda i, *rest: [] if 300 <= i < 400 else [rest]), "no IMU data")

    def test_doubled(self):
        self.expect_run(bags.for_topic(IMU, lambda _, *rest: [rest, rest]), "repeated", "only one driver")

    def test_out_of_order(self):
        self.expect_run(bags.for_topic(IMU, bags.neighbours_swapped(5)), "out of order")

    def test_in_g(self):
        def to_g(_, reading):
            acceleration = reading.linear_acceleration
            for axis in "xyz":
                setattr(acceleration, axis, getattr(acceleration, axis) / 9.80665)

        self.expect_refusal(bags.readings(to_g), "set sensor.acceleration_unit to g")
        for unit in ("g", "auto"):
            self.expect_run(bags.readings(to_g), arguments=("--set", f"sensor.acceleration_unit={unit}"))

    def test_gyro_in_degrees(self):
        # The street begins at rest, so let the gyro turn as nothing on wheels would: by 10 deg/s on each axis.
        def to_degrees(_, reading):
            velocity = reading.angular_velocity
            for axis in "xyz":
                setattr(velocity, axis, np.degrees(getattr(velocity, axis)) + 10.0)

        self.expect_refusal(bags.readings(to_degrees), "deg/s")

    def test_nan(self):
        def break_every(step):
            return bags.readings(lambda i, reading: setattr(reading.linear_acceleration, "x", NAN)
                                 if i % step == 0 else None)

        self.expect_run(break_every(10), "NaN")
        self.expect_run(break_every(1), "NaN", "without an IMU", max_error_m=0.5)

    def test_glitches(self):
        def glitch(part, axis, value):
            return bags.readings(lambda i, reading: setattr(getattr(reading, part), axis, value)
                                 if i % 150 == 80 else None)

        self.expect_run(glitch("linear_acceleration", "x", 1e6), "no sensor measures", "sensor.max_acceleration")
        self.expect_run(glitch("angular_velocity", "z", -1e4), "no sensor measures", "sensor.max_angular_rate")

    def test_absent(self):
        self.expect_run(bags.for_topic(IMU, lambda *_: []), "no IMU messages on '/imu_raw'", max_error_m=0.5)

    def test_late(self):
        self.expect_run(bags.for_topic(IMU, lambda i, *rest: [] if i < 200 else [rest]), "the IMU covers only",
                        max_error_m=0.5)


class Files(BadInput):
    def test_rotation_that_is_none(self):
        for rotation in ("[1,0,0,0,1,0,0,0,-1]", "[0,0,0,2]"):
            done = self.run_slam("--set", f"sensor.T_imu_lidar.rotation={rotation}", bag=self.good)
            self.assertEqual(done.returncode, 2)
            self.assertIn("sensor.T_imu_lidar.rotation", done.stderr)

    def test_without_index(self):
        bags.write_without_index(self.good, self.broken)
        done = self.run_slam()
        self.assertEqual(done.returncode, 2)
        self.assertIn(f"rosbag reindex {self.broken}", done.stderr)

    def test_no_bag_at_all(self):
        for content in (b"", b"no bag\n" * 100):
            self.broken.write_bytes(content)
            done = self.run_slam()
            self.assertEqual(done.returncode, 2)
            self.assertIn(str(self.broken), done.stderr)

    def test_messages_that_were_cut_off(self):
        for topic, scans in ((POINTS, 48), (IMU, SCANS)):
            bags.cut_messages(self.good, self.broken, topic, 5)
            done = self.run_slam()
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn(f"a message on {topic} was dropped", done.stderr)
            self.assertEqual(len(read_tum(self.output / "trajectory.tum")), scans)

    def test_damage_keeps_what_came_before(self):
        bags.damage_chunk(self.good, self.broken, 0.9)
        done = self.run_slam()
        self.assertEqual(done.returncode, 2)
        self.assertIn("cannot be read to its end", done.stderr)
        self.assertGreater(len(read_tum(self.output / "trajectory.tum")), SCANS // 2)
        self.assertGreater((self.output / "map.pcd").stat().st_size, 0)

    def test_full_disk(self):
        if os.geteuid() != 0:
            self.skipTest("needs root, for a small file system")
        disk = self.path / "disk"
        disk.mkdir()
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], capture_output=True)
        if mounted.returncode != 0:
            self.skipTest("this machine lets nobody mount")
        try:
            done = self.run_slam(bag=self.good, output=disk / "run")
        finally:
            subprocess.run(["umount", disk], check=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn(str(disk / "run"), done.stderr)
        self.assertIn("space", done.stderr)


if __name__ == "__main__":
    SOURCE = pathlib.Path(sys.argv.pop()).resolve()
    BIN = pathlib.Path(sys.argv.pop()).resolve()
    unittest.main(verbosity=2)
