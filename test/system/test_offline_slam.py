#!/usr/bin/python3
"""The whole system on a simulated street: trajectory error against the truth, repeatability, and bad input.

usage: test_offline_slam.py BIN_DIR SOURCE_DIR
"""
import filecmp
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import numpy as np
import rosbag
import rospy
import yaml

import broken_bags

BIN = pathlib.Path()
SOURCE = pathlib.Path()
DURATION_S = 20


def read_tum(path):
    return np.loadtxt(path, ndmin=2)


def ate_rmse(estimate, truth):
    """RMSE of the translation after the rigid alignment of Horn (closed form by SVD), truth interpolated in time."""
    inside = (estimate[:, 0] >= truth[0, 0]) & (estimate[:, 0] <= truth[-1, 0])
    p = estimate[inside, 1:4]
    q = np.stack([np.interp(estimate[inside, 0], truth[:, 0], truth[:, k]) for k in (1, 2, 3)], axis=1)
    p0, q0 = p - p.mean(axis=0), q - q.mean(axis=0)
    u, _, vt = np.linalg.svd(q0.T @ p0)
    rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return float(np.sqrt(np.mean(np.sum((p0 @ rotation.T - q0) ** 2, axis=1))))


class OfflineSlam(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        cls.bag = cls.path / "street.bag"
        others = "gnss.enabled=true gnss.rate=5 gnss.noise=0.3 gnss.drift=0.1 gnss.outage_share=0 wheels.enabled=true"
        settings = [word for pair in others.split() for word in ("--set", pair)]
        subprocess.run(
            [BIN / "simulate_bag", "--scenario", SOURCE / "config/scenarios/street.yaml", "--seed", "7", "--output",
             cls.bag, "--duration", str(DURATION_S), *settings], check=True, capture_output=True)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def command(self, name, *arguments, bag=None):
        return [BIN / "offline_slam", "--config", SOURCE / "config/hdl64e.yaml", "--bag", bag or self.bag, "--output",
                self.path / name, "--set", "sensor.T_imu_lidar.translation=[0,0,0.3]", *arguments]

    def run_slam(self, name, *arguments, bag=None):
        return subprocess.run(self.command(name, *arguments, bag=bag), capture_output=True, text=True, check=False)

    def test_trajectory_is_close_to_the_truth(self):
        done = self.run_slam("accuracy")
        self.assertEqual(done.returncode, 0, done.stderr)
        estimate = read_tum(self.path / "accuracy/trajectory.tum")
        truth = read_tum(self.path / "street.tum")
        self.assertGreaterEqual(len(estimate), 10 * DURATION_S - 1)
        self.assertTrue(np.isfinite(estimate).all())
        way = np.sum(np.linalg.norm(np.diff(truth[:, 1:4], axis=0), axis=1))
        self.assertGreater(way, 100.0)
        self.assertLess(ate_rmse(estimate, truth), 0.1)
        for name in ("map.pcd", "degeneracy.csv", "timing.json", "run.yaml", "odometry.tum"):
            self.assertGreater((self.path / "accuracy" / name).stat().st_size, 0, name)

    def test_an_offset_of_the_clocks_is_found_and_named(self):
        made_s = 0.03
        done = self.run_slam("clocks", "--set", f"sensor.lidar_time_offset={made_s}")
        self.assertEqual(done.returncode, 0, done.stderr)
        said = re.search(r"the stamps of the scans seem to be ([0-9.]+) ms too late", done.stderr)
        self.assertIsNotNone(said, done.stderr)
        self.assertAlmostEqual(1e-3 * float(said.group(1)), made_s, delta=3e-3)
        estimate = read_tum(self.path / "clocks/odometry.tum")
        estimate[:, 0] -= made_s
        self.assertLess(ate_rmse(estimate, read_tum(self.path / "street.tum")), 0.1)

    def test_a_lidar_whose_clock_starts_with_it_is_stamped_by_reception(self):
        path = self.path / "boot.bag"
        with rosbag.Bag(self.bag) as source, rosbag.Bag(path, "w") as target:
            begin = rospy.Time(source.get_start_time())
            for topic, message, received in source.read_messages(["/points_raw", "/imu_raw"]):
                if topic == "/points_raw":
                    message.header.stamp = rospy.Time() + (message.header.stamp - begin) + rospy.Duration(20.0)
                target.write(topic, message, received)
                if (received - begin).to_sec() > 12.0:
                    break
        done = self.run_slam("boot_header", bag=path)
        self.assertEqual(done.returncode, 2, done.stderr)
        for text in ("no time in common", "sensor.time_source"):
            self.assertIn(text, done.stderr)
        done = self.run_slam("boot_received", "--set", "sensor.time_source=receive", bag=path)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.run_slam("boot_truly", "--duration", "12").returncode, 0)
        estimate = read_tum(self.path / "boot_received/odometry.tum")
        truly = read_tum(self.path / "boot_truly/odometry.tum")
        self.assertEqual(len(estimate), len(truly))
        late = estimate[:, 0] - truly[:, 0]
        self.assertTrue(0.0 < late.min() and late.max() < 0.05, late)
        self.assertLess(np.ptp(late[20:]), 2e-3)
        self.assertLess(np.linalg.norm(estimate[:, 1:4] - truly[:, 1:4], axis=1).max(), 0.05)

    def test_runs_are_equal_bit_for_bit_with_any_number_of_threads(self):
        for name, threads in (("one", 1), ("two", 2), ("again", 2)):
            self.assertEqual(self.run_slam(name, "--set", f"threads={threads}", "--duration", "8").returncode, 0)
        for other in ("two", "again"):
            for name in ("trajectory.tum", "odometry.tum", "map.pcd", "degeneracy.csv"):
                self.assertTrue(filecmp.cmp(self.path / "one" / name, self.path / other / name, shallow=False),
                                f"{name} of '{other}'")

    def test_after_a_gap_that_leads_out_of_the_map_a_new_one_is_begun(self):
        tunnel, gap = self.path / "tunnel.bag", self.path / "gap.bag"
        subprocess.run(
            [BIN / "simulate_bag", "--scenario", SOURCE / "config/scenarios/tunnel_hard.yaml", "--seed", "7", "--output",
             tunnel, "--duration", "30"], check=True, capture_output=True)
        broken_bags.rewrite(tunnel, gap, broken_bags.for_topic(
            "/points_raw", lambda i, *rest: [] if 130 <= i < 220 else [rest]))
        done = subprocess.run(
            [BIN / "offline_slam", "--config", self.path / "tunnel.config.yaml", "--bag", gap, "--output",
             self.path / "gap"], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("a new one is begun at the predicted pose", done.stderr)
        estimate, truth = read_tum(self.path / "gap/odometry.tum"), read_tum(self.path / "tunnel.tum")
        after = estimate[estimate[:, 0] > truth[0, 0] + 24.0]
        self.assertGreater(len(after), 50)
        self.assertLess(ate_rmse(after, truth), 0.5)

    def test_a_start_in_motion(self):
        for name, arguments in (("moving", ()), ("moving_lidar", ("--set", "sensor.imu_topic=/none"))):
            with self.subTest(name):
                done = self.run_slam(name, "--start", "10", *arguments)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("started in motion", done.stderr)
                estimate = read_tum(self.path / name / "trajectory.tum")
                self.assertGreater(np.linalg.norm(np.diff(estimate[:6, 1:4], axis=0), axis=1).min(), 0.5)
                self.assertLess(ate_rmse(estimate, read_tum(self.path / "street.tum")), 0.2)

    def test_a_start_at_speed_on_a_motorway(self):
        """Nothing but traffic and paint tells the speed: after some scans, those before are estimated anew."""
        subprocess.run(
            [BIN / "simulate_bag", "--scenario", SOURCE / "config/scenarios/highway.yaml", "--seed", "7", "--output",
             self.path / "highway.bag", "--duration", "8", "--set", "motion.start_speed=28"],
            check=True, capture_output=True)
        done = subprocess.run(
            [BIN / "offline_slam", "--config", self.path / "highway.config.yaml", "--bag", self.path / "highway.bag",
             "--output", self.path / "highway"], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("scans were estimated anew", done.stderr)
        truth = read_tum(self.path / "highway.tum")
        for name in ("trajectory.tum", "odometry.tum"):
            estimate = read_tum(self.path / "highway" / name)
            self.assertGreaterEqual(len(estimate), 79)
            steps = np.linalg.norm(np.diff(estimate[:, 1:4], axis=0), axis=1) / np.diff(estimate[:, 0])
            self.assertLess(np.abs(steps[:6] - 28.0).max(), 2.0, name)
            self.assertLess(ate_rmse(estimate, truth), 2.0, name)

    def test_lidar_alone_works_with_a_warning(self):
        done = self.run_slam("lidar", "--set", "sensor.imu_topic=/none")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("/imu_raw", done.stderr)
        estimate = read_tum(self.path / "lidar/trajectory.tum")
        self.assertLess(ate_rmse(estimate, read_tum(self.path / "street.tum")), 1.0)

    def test_fixes_and_wheels_move_the_map_and_not_the_odometry(self):
        self.assertEqual(self.run_slam("alone").returncode, 0)
        both = ("--set", "gnss.enabled=true", "--set", "external_odometry.enabled=true")
        done = self.run_slam("both", *both)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("true way over the way that the other odometry says: ", done.stderr)
        self.assertIn("accepted", (self.path / "both/fixes.csv").read_text())
        self.assertTrue(filecmp.cmp(self.path / "alone/odometry.tum", self.path / "both/odometry.tum", shallow=False))
        estimate = read_tum(self.path / "both/trajectory.tum")
        self.assertLess(ate_rmse(estimate, read_tum(self.path / "street.tum")), 0.3)
        apart = estimate[:, 1:4] - read_tum(self.path / "both/odometry.tum")[:, 1:4]
        self.assertGreater(np.linalg.norm(apart, axis=1).max(), 1e-3)
        # On the earth: the simulator's map has its origin at 49.0, 8.4 and x pointing east.
        reference = yaml.safe_load((self.path / "both/georeference.yaml").read_text())
        east = (reference["origin"]["longitude"] - 8.4) * 111320.0 * np.cos(np.radians(49.0))
        north = (reference["origin"]["latitude"] - 49.0) * 111229.0
        in_enu, truth = read_tum(self.path / "both/trajectory_enu.tum"), read_tum(self.path / "street.tum")
        true_xy = np.stack([np.interp(in_enu[:, 0], truth[:, 0], truth[:, k]) for k in (1, 2)], axis=1)
        off = np.linalg.norm(in_enu[:, 1:3] + [east, north] - true_xy, axis=1)
        self.assertLess(off.max(), 8.0)  # fixes are off by 1.8 m, much of it for a minute
        self.assertFalse((self.path / "alone/georeference.yaml").exists())
        missing = self.run_slam("missing", "--duration", "3", *both, "--set", "sensor.gnss_topic=/none",
                                "--set", "sensor.external_odometry_topic=/imu_raw")
        self.assertEqual(missing.returncode, 0, missing.stderr)
        self.assertIn("sensor.gnss_topic", missing.stderr)
        self.assertIn("sensor.external_odometry_topic", missing.stderr)

    def test_wrong_topic_names_those_that_would_do(self):
        two = self.path / "two_lidars.bag"
        with rosbag.Bag(str(self.bag)) as source, rosbag.Bag(str(two), "w") as bag:
            for topic, message, stamp in source.read_messages(["/points_raw"]):
                bag.write(topic, message, stamp)
                bag.write("/rear/points", message, stamp)
        done = self.run_slam("topic", "--set", "sensor.points_topic=/none", bag=two)
        self.assertEqual(done.returncode, 2)
        self.assertIn("/points_raw, /rear/points", done.stderr)

    def test_the_only_lidar_takes_the_place_of_a_missing_topic(self):
        self.assertEqual(self.run_slam("named", "--duration", "3").returncode, 0)
        done = self.run_slam("only", "--duration", "3", "--set", "sensor.points_topic=/none")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("no lidar messages on /none: taking /points_raw", done.stderr)
        self.assertTrue(filecmp.cmp(self.path / "named/map.pcd", self.path / "only/map.pcd", shallow=False))

    def test_missing_and_truncated_bags_are_named(self):
        done = self.run_slam("missing", bag=self.path / "missing.bag")
        self.assertEqual(done.returncode, 2)
        self.assertIn("missing.bag", done.stderr)
        truncated = self.path / "truncated.bag"
        truncated.write_bytes(self.bag.read_bytes()[:1000000])
        done = self.run_slam("truncated", bag=truncated)
        self.assertEqual(done.returncode, 2)
        self.assertIn("truncated.bag", done.stderr)

    def test_output_that_cannot_be_made_is_named(self):
        (self.path / "file").write_text("in the way")
        done = self.run_slam("file/below")
        self.assertEqual(done.returncode, 2)
        self.assertIn("file/below", done.stderr)

    def test_wrong_parameters_stop_before_the_start(self):
        done = self.run_slam("parameters", "--set", "mapping.typo=1")
        self.assertEqual(done.returncode, 2)
        self.assertIn("mapping.typo", done.stderr)

    def test_interrupt_keeps_what_was_done(self):
        process = subprocess.Popen(self.command("interrupt"), stderr=subprocess.PIPE)
        trajectory = self.path / "interrupt/trajectory.tum"
        deadline = time.monotonic() + 60.0
        while time.monotonic() < deadline and (not trajectory.exists() or trajectory.stat().st_size < 500):
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130)
        self.assertGreater(len(read_tum(trajectory)), 2)
        self.assertGreater((self.path / "interrupt/map.pcd").stat().st_size, 0)


if __name__ == "__main__":
    SOURCE = pathlib.Path(sys.argv.pop()).resolve()
    BIN = pathlib.Path(sys.argv.pop()).resolve()
    unittest.main(verbosity=2)
