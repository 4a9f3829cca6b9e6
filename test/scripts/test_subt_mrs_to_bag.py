"""subt_mrs_to_bag.py on bags that hold velodyne_msgs/VelodyneScan and an IMU."""

import math

import numpy as np
import pytest
from bags import messages_by_topic
from vlp16_packets import packet, scan_message

from fdi_lio_scripts.bag_writing import BagWriter
from fdi_lio_scripts.ros_messages import cloud_points, message_class, nanoseconds, ros_time

START_NS = 1_600_000_000 * 10**9


def floor_shot(_block, _firing, laser):
    """Flat ground 1 m below the sensor; beams above the horizon see nothing."""
    angle = [-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15][laser]
    return (round(1.0 / math.sin(math.radians(-angle)) / 0.002), 20) if angle < 0 else (0, 0)


def write_bag(path, scans=3, start_ns=START_NS, product=0x22, topic="/velodyne_packets"):
    """Scans at 10 Hz and the IMU at 100 Hz, in order of time."""
    with BagWriter(str(path), overwrite=False) as bag:
        for i in range(scans):
            scan_ns = start_ns + i * 100_000_000
            for k in range(10):
                imu = message_class("sensor_msgs/Imu")()
                imu.header.stamp = ros_time(scan_ns + k * 10_000_000)
                imu.linear_acceleration.z = 9.81 + i + 0.01 * k
                bag.write("/imu/data", imu, scan_ns + k * 10_000_000)
            packets = [
                (
                    scan_ns + p * 1_327_104, packet(p * 12 * 40 % 36000, 40, floor_shot, product=product)
                ) for p in range(75)
            ]
            bag.write(topic, scan_message(packets), scan_ns + 100_000_000)
    return path


def test_ground_comes_back_flat_and_imu_untouched(run_script, tmp_path):
    source = write_bag(tmp_path / "in.bag")
    done = run_script("subt_mrs_to_bag.py", source, tmp_path / "out.bag")
    assert done.returncode == 0, done.stderr
    before, after = messages_by_topic(source), messages_by_topic(tmp_path / "out.bag")
    assert sorted(after) == ["/imu/data", "/velodyne_points"]
    assert after["/imu/data"] == before["/imu/data"]
    assert len(after["/velodyne_points"]) == 3
    for i, cloud in enumerate(after["/velodyne_points"]):
        assert nanoseconds(cloud.header.stamp) == START_NS + i * 100_000_000
        assert cloud.header.frame_id == "velodyne" and cloud.point_step == 22
        points = cloud_points(cloud)
        assert len(points) == 75 * 24 * 8
        # 1 m below, to within the 2 mm steps of the range and the lasers' heights of up to 11.2 mm
        np.testing.assert_allclose(points["z"], -1.0, atol=0.0125)
        assert set(points["ring"]) == set(range(8))
        assert 0 <= points["time"].min() and points["time"].max() < 0.1
    assert f"{3 * 75 * 24 * 8} without return" in done.stdout


def test_parts_are_put_in_order_and_topics_can_be_skipped(run_script, tmp_path):
    later = write_bag(tmp_path / "a.bag", start_ns=START_NS + 10**9)
    earlier = write_bag(tmp_path / "b.bag")
    done = run_script("subt_mrs_to_bag.py", later, earlier, tmp_path / "out.bag", "--skip", "/imu/data",
                      "--points-topic", "/points_raw", "--compression", "lz4")
    assert done.returncode == 0, done.stderr
    found = messages_by_topic(tmp_path / "out.bag")
    assert sorted(found) == ["/points_raw"]
    stamps = [nanoseconds(cloud.header.stamp) - START_NS for cloud in found["/points_raw"]]
    assert stamps == [0, 100_000_000, 200_000_000, 10**9, 1_100_000_000, 1_200_000_000]


@pytest.mark.parametrize("text", [
    "1600000000000000123,1,2,3,0,0,0,1\n1600000000100000456,1.5,2,3,0,0,0.6,0.8\n",
    "timestamp,x,y,z,qx,qy,qz,qw\n1600000000.000000123,1,2,3,0,0,0,1\n"
    "1600000000.100000456,1.5,2,3,0,0,0.6,0.8\n",
    "# nsec, qw, qx, qy, qz, x, y, "
    "z\n1600000000000000123,1,0,0,0,1,2,3\n1600000000100000456,0.8,0,0,0.6,1.5,2,3\n",
    "sec,nsec,px,py,pz,qx,qy,qz,qw\n1600000000,123,1,2,3,0,0,0,1\n1600000000,100000456,1.5,2,3,0,0,0.6,0.8\n",
    "1600000000.100000456 1.5 2 3 0 0 0.6 0.8\n1600000000.000000123 1 2 3 0 0 0 1\n",
])
def test_ground_truth_tables(run_script, tmp_path, text):
    (tmp_path / "truth.csv").write_text(text)
    done = run_script("subt_mrs_to_bag.py", write_bag(tmp_path / "in.bag", 1), tmp_path / "out.bag",
                      "--ground-truth", tmp_path / "truth.csv")
    assert done.returncode == 0, done.stderr
    lines = [
        line for line in (tmp_path / "out_truth.tum").read_text().splitlines() if not line.startswith("#")
    ]
    assert [line.split()[0] for line in lines] == ["1600000000.000000123", "1600000000.100000456"]
    np.testing.assert_allclose(
        [float(word) for word in lines[1].split()[1:]], [1.5, 2, 3, 0, 0, 0.6, 0.8], atol=1e-9
    )


@pytest.mark.parametrize("text, words", [
    ("", ["empty"]),
    ("1,2,3\n", ["3 columns"]),
    ("timestamp,x,y,z\n1,2,3,4\n", ["no column for qx"]),
    ("x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1\n", ["no column of times"]),
    ("1600000000,1,2,3,0,0,0,1\n1600000001,1,2,oops,0,0,0,1\n", ["row 2"]),
    ("1600000000,1,2,3,0,0,0,0\n", ["quaternions"]),
])
def test_bad_ground_truth_is_explained(run_script, tmp_path, text, words):
    (tmp_path / "truth.csv").write_text(text)
    done = run_script("subt_mrs_to_bag.py", write_bag(tmp_path / "in.bag", 1), tmp_path / "out.bag",
                      "--ground-truth", tmp_path / "truth.csv")
    assert done.returncode == 2 and "Traceback" not in done.stderr and not (tmp_path / "out.bag").exists()
    for word in words:
        assert word in done.stderr


def test_bags_without_packets_or_with_several_topics(run_script, tmp_path):
    with BagWriter(str(tmp_path / "imu.bag"), overwrite=False) as bag:
        bag.write("/imu/data", message_class("sensor_msgs/Imu")(), START_NS)
    done = run_script("subt_mrs_to_bag.py", tmp_path / "imu.bag", tmp_path / "out.bag")
    assert done.returncode == 2 and "SubT-MRS" in done.stderr
    first, second = write_bag(tmp_path / "1.bag", 1, topic="/left"), write_bag(
        tmp_path / "2.bag", 1, topic="/right"
    )
    done = run_script("subt_mrs_to_bag.py", first, second, tmp_path / "out.bag")
    assert done.returncode == 2 and "/left, /right" in done.stderr and "--scan-topic" in done.stderr
    done = run_script("subt_mrs_to_bag.py", first, second, tmp_path / "out.bag", "--scan-topic", "/left")
    assert done.returncode == 0, done.stderr
    assert len(messages_by_topic(tmp_path / "out.bag")["/velodyne_points"]) == 1


def test_wrong_sensor_missing_and_unindexed_bags(run_script, tmp_path):
    done = run_script(
        "subt_mrs_to_bag.py", write_bag(tmp_path / "32.bag", 1, product=0x28), tmp_path / "out.bag"
    )
    assert done.returncode == 2 and "VLP-32C" in done.stderr
    assert not (tmp_path / "out.bag").exists()
    done = run_script("subt_mrs_to_bag.py", tmp_path / "no.bag", tmp_path / "out.bag")
    assert done.returncode == 2 and "no such file" in done.stderr
    whole = write_bag(tmp_path / "in.bag").read_bytes()
    (tmp_path / "cut.bag").write_bytes(whole[: len(whole) // 2])
    done = run_script("subt_mrs_to_bag.py", tmp_path / "cut.bag", tmp_path / "out.bag")
    assert done.returncode == 2 and "Traceback" not in done.stderr and "cut.bag" in done.stderr
