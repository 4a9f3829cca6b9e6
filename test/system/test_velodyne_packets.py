#!/usr/bin/python3
"""Bags of VLP-16 packets: the decoder of the system against that of the scripts, and a run through a room.

usage: test_velodyne_packets.py BIN_DIR TEST_BIN_DIR SOURCE_DIR
"""
import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

import genpy
import numpy as np
import rosbag

BIN = pathlib.Path()
TEST_BIN = pathlib.Path()
SOURCE = pathlib.Path()
START_NS = 1_700_000_000_000_000_000
PACKET_NS = 1_327_104
PACKETS = 76
SPEED_MPS = 0.5
HALF_ROOM_M = np.array([6.0, 4.0, 1.5])
ELEVATION = np.radians([-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15])


def room_shots(azimuth_units, turn, time_s):
    """Distances in 2 mm and reflectivities of one packet, (12, 2, 16), on the way along x through a box."""
    in_block = 55.296e-6 * np.arange(2)[:, None] + 2.304e-6 * np.arange(16)
    block = np.arange(12)[:, None, None]
    azimuth = np.radians(0.01 * (azimuth_units + turn * (block + in_block / 110.592e-6)))
    cos = np.cos(ELEVATION)
    ray = np.stack([cos * np.cos(azimuth), -cos * np.sin(azimuth), np.sin(ELEVATION) + 0 * azimuth], axis=-1)
    x = SPEED_MPS * (time_s + block * 110.592e-6 + in_block)
    position = np.stack([x, 0 * x, 0 * x], axis=-1)
    ray[ray == 0] = 1e-12
    wall = np.where(ray > 0, HALF_ROOM_M - position, -HALF_ROOM_M - position) / ray
    distance = np.round(wall.min(axis=-1) / 0.002).astype(int)
    return distance, (np.argmin(wall, axis=-1) * 40 + block + distance % 7) % 256


def random_shots(random, _azimuth, _turn, _time):
    """Returns without order: what no decoder gets right by chance. A tenth of the shots meets nothing."""
    distance = random.integers(1, 50000, (12, 2, 16)) * (random.random((12, 2, 16)) > 0.1)
    return distance, random.integers(0, 256, (12, 2, 16))


def write_bag(path, scans, shots, dual=False):
    """`scans` revolutions at 10 Hz; the sensor's clock crosses the full hour on the way."""
    from vlp16_packets import packet, scan_message

    with rosbag.Bag(str(path), "w") as bag:
        for scan in range(scans):
            packets = []
            for i in range(PACKETS):
                count = scan * PACKETS + i
                since_start_ns = count * PACKET_NS // (2 if dual else 1)
                turn = 40
                azimuth = count * (6 if dual else 12) * turn % 36000
                distance, reflectivity = shots(azimuth, turn, since_start_ns * 1e-9)
                data = packet(azimuth, turn, lambda b, f, l: (int(distance[b, f, l]), int(reflectivity[b, f, l])),
                              mode=0x39 if dual else 0x37, pair=dual)
                sensor_us = (3_599_900_000 + since_start_ns // 1000) % 3_600_000_000
                packets.append((START_NS + since_start_ns, data[:1200] + struct.pack("<I", sensor_us) + data[1204:]))
            message = scan_message(packets)
            bag.write("/velodyne_packets", message, message.header.stamp + genpy.Duration(0, 1_500_000))


def dump(bag, topic):
    """Scans as (stamp in ns, array of x y z intensity ring time), the points in the order of time and ring."""
    lines = subprocess.run([TEST_BIN / "dump_test_scans", bag, topic], check=True, capture_output=True, text=True).stdout
    scans = []
    for part in lines.split("scan ")[1:]:
        head, _, rest = part.partition("\n")
        points = np.fromstring(rest, sep=" ").reshape(-1, 6)
        assert len(points) == int(head.split()[1])
        scans.append((int(head.split()[0]), points[np.lexsort((points[:, 4], np.round(points[:, 5] * 1e7)))]))
    return scans


class VelodynePackets(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.folder.name)
        self.bag = self.path / "packets.bag"

    def tearDown(self):
        self.folder.cleanup()

    def expect_equal_to_the_script(self):
        converted = self.path / "clouds.bag"
        subprocess.run([SOURCE / "scripts/subt_mrs_to_bag.py", self.bag, converted], check=True, capture_output=True)
        ours = dump(self.bag, "/velodyne_packets")
        theirs = dump(converted, "/velodyne_points")
        self.assertEqual(len(ours), len(theirs))
        for (our_stamp, our_points), (their_stamp, their_points) in zip(ours, theirs):
            # The sensor's clock has microseconds, and the cloud's times are of single precision.
            self.assertLess(abs(our_stamp - their_stamp), 2000)
            self.assertEqual(our_points.shape, their_points.shape)
            np.testing.assert_allclose(our_points[:, :3], their_points[:, :3], rtol=2e-7, atol=1e-8)
            np.testing.assert_array_equal(our_points[:, 3:5], their_points[:, 3:5])
            np.testing.assert_allclose(our_points[:, 5], their_points[:, 5], atol=2e-6)
        return ours

    def test_single_returns_decode_like_the_script(self):
        random = np.random.default_rng(1)
        write_bag(self.bag, 3, lambda *shot: random_shots(random, *shot))
        ours = self.expect_equal_to_the_script()
        self.assertEqual(len(ours), 3)
        self.assertGreater(len(ours[0][1]), 20000)

    def test_dual_returns_decode_like_the_script(self):
        random = np.random.default_rng(2)
        write_bag(self.bag, 2, lambda *shot: random_shots(random, *shot), dual=True)
        self.assertGreater(len(self.expect_equal_to_the_script()[0][1]), 10000)

    def test_a_run_on_packets_follows_the_motion(self):
        write_bag(self.bag, 30, room_shots)
        run = subprocess.run(
            [BIN / "offline_slam", "--config", SOURCE / "config/subt_mrs.yaml", "--bag", self.bag, "--output",
             self.path / "run"],
            capture_output=True, text=True, check=False)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("VLP-16 packets", run.stderr)
        self.assertIn("taking /velodyne_packets", run.stderr)
        poses = np.loadtxt(self.path / "run/trajectory.tum")
        self.assertEqual(len(poses), 30)
        way = np.linalg.norm(poses[-1, 1:4] - poses[0, 1:4])
        self.assertLess(abs(way - SPEED_MPS * (poses[-1, 0] - poses[0, 0])), 0.05)
        self.assertTrue(math.isclose(poses[0, 0], START_NS * 1e-9 + PACKETS * PACKET_NS * 1e-9, abs_tol=1e-4))

    def test_a_message_that_was_cut_off_is_named(self):
        write_bag(self.bag, 1, room_shots)
        broken = self.path / "broken.bag"
        with rosbag.Bag(str(self.bag)) as source, rosbag.Bag(str(broken), "w") as bag:
            for topic, (kind, data, md5, position, classes), time in source.read_messages(raw=True):
                bag.write(topic, (kind, data[:-1], md5, position, classes), time, raw=True)
        run = subprocess.run(
            [BIN / "offline_slam", "--config", SOURCE / "config/subt_mrs.yaml", "--bag", broken, "--output",
             self.path / "run"],
            capture_output=True, text=True, check=False)
        self.assertEqual(run.returncode, 2)
        self.assertIn("velodyne_msgs/VelodyneScan was dropped", run.stderr)


if __name__ == "__main__":
    SOURCE = pathlib.Path(sys.argv.pop()).resolve()
    TEST_BIN = pathlib.Path(sys.argv.pop()).resolve()
    BIN = pathlib.Path(sys.argv.pop()).resolve()
    sys.path.insert(0, str(SOURCE / "test/scripts"))
    unittest.main(verbosity=2)
