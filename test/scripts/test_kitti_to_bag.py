"""kitti_to_bag.py on drives in KITTI's layout: positions, times, rings, IMU order and gaps, cuts, truth."""

import lzma

import numpy as np
import pytest
from bags import messages_by_topic
from kitti_files import DATE, DRIVE, R_VELO_IMU, START_NS, T_VELO_IMU
from kitti_files import oxts_row, scan_points, write_drive, write_oxts

from fdi_lio_scripts.kitti_sequences import SEQUENCES, sequence_range
from fdi_lio_scripts.ros_messages import cloud_points, nanoseconds


@pytest.fixture
def converted(run_script, tmp_path):
    """A converted drive of 5 scans: messages by topic, stdout, folder."""
    drive = write_drive(tmp_path)
    done = run_script("kitti_to_bag.py", "--drive", drive.sync, tmp_path / "o.bag")
    assert done.returncode == 0, done.stderr
    return messages_by_topic(tmp_path / "o.bag"), done.stdout, tmp_path


def test_cloud_layout_is_that_of_the_velodyne_driver(converted):
    clouds = converted[0]["/points_raw"]
    assert len(clouds) == 5
    cloud = clouds[0]
    assert [(f.name, f.offset, f.datatype, f.count) for f in cloud.fields] == [
        ("x", 0, 7, 1), ("y", 4, 7, 1), ("z", 8, 7, 1), (
            "intensity", 12, 7, 1
        ), ("ring", 16, 4, 1), ("time", 18, 7, 1)
    ]
    assert (cloud.point_step, cloud.height, cloud.width) == (22, 1, 64 * 360)
    assert cloud.row_step == 22 * cloud.width == len(cloud.data)
    assert cloud.is_dense and not cloud.is_bigendian and cloud.header.frame_id == "velodyne"


def test_points_keep_their_values_and_get_ring_and_time(converted):
    points = cloud_points(converted[0]["/points_raw"][0])
    scan = scan_points()
    for column, name in enumerate(("x", "y", "z", "intensity")):
        np.testing.assert_array_equal(points[name], scan[:, column])
    np.testing.assert_array_equal(points["ring"], np.repeat(np.arange(63, -1, -1), 360))
    azimuth = np.degrees(np.arctan2(scan[:, 1], scan[:, 0]))
    np.testing.assert_allclose(points["time"], 0.1 * (180 - azimuth) / 360, atol=1e-7)
    assert points["time"].min() >= 0 and points["time"].max() < 0.1


def test_stamps_are_the_starts_of_the_sweeps(converted):
    stamps = [nanoseconds(cloud.header.stamp) for cloud in converted[0]["/points_raw"]]
    assert stamps == [START_NS + 2 * 10**9 + 100_000_000 * i for i in range(5)]


def test_imu_has_the_right_columns_and_a_lead_of_one_second(converted):
    imu = converted[0]["/imu_raw"]
    stamps = np.array([nanoseconds(m.header.stamp) for m in imu]) - START_NS
    assert stamps[0] == 10**9 and np.all(np.diff(stamps) == 10_000_000) and stamps[-1] == 2_500_000_000
    for message in (imu[0], imu[77]):
        seconds = (nanoseconds(message.header.stamp) - START_NS) * 1e-9
        row = oxts_row(seconds)
        a, w, q = message.linear_acceleration, message.angular_velocity, message.orientation
        np.testing.assert_allclose([a.x, a.y, a.z], row[11:14], atol=1e-12)
        np.testing.assert_allclose([w.x, w.y, w.z], row[17:20], atol=1e-12)
        np.testing.assert_allclose(
            [q.x, q.y, q.z, q.w], [0, 0, np.sin(0.05 * seconds), np.cos(0.05 * seconds)], atol=1e-9
        )
        assert message.header.frame_id == "imu_link"
        assert min(np.diag(np.reshape(message.orientation_covariance, (3, 3)))) > 0


def test_gnss_fixes_come_at_ten_hertz(converted):
    fixes = converted[0]["/gps/fix"]
    stamps = np.array([nanoseconds(m.header.stamp) for m in fixes])
    np.testing.assert_allclose(np.diff(stamps) * 1e-9, 0.1, atol=0.011)
    row = oxts_row((stamps[3] - START_NS) * 1e-9)
    np.testing.assert_allclose(
        [fixes[3].latitude, fixes[3].longitude, fixes[3].altitude], row[:3], atol=1e-12
    )
    assert fixes[3].status.status == 0 and fixes[3].position_covariance[0] == pytest.approx(0.0025)


def test_truth_is_east_north_up_from_the_first_packet(converted):
    rows = np.loadtxt(converted[2] / "o_imu.tum")
    seconds = rows[:, 0] - rows[0, 0]
    np.testing.assert_allclose(rows[:, 1], 10 * seconds, atol=1e-4)  # 10 m/s east
    np.testing.assert_allclose(rows[:, 2], 0, atol=1e-6)
    np.testing.assert_allclose(rows[:, 3], 0.5 * seconds, atol=1e-6)
    # yaw
    np.testing.assert_allclose(2 * np.arctan2(rows[:, 6], rows[:, 7]), 0.1 * (seconds + 1.0), atol=1e-6)
    first = (converted[2] / "o_imu.tum").read_text().splitlines()[2].split()[0]
    assert first == f"{(START_NS + 10**9) // 10**9}.000000000"


def test_mercator_scale_holds_to_the_north():
    from fdi_lio_scripts.kitti_raw import Oxts, mercator_positions

    values = np.zeros((2, 30))
    values[:, 0] = [49.0, 49.0 + np.degrees(100.0 / 6378137.0)]  # 100 m north on the sphere
    flat = mercator_positions(Oxts(np.array([0, 1]), values, 0, 0))
    np.testing.assert_allclose(flat[1], [0, 100, 0], atol=2e-3)  # the scale grows by 1e-5 over 100 m


def test_extrinsic_is_printed_as_imu_from_lidar(converted):
    numbers = {}
    for line in converted[1].splitlines():
        name, _, rest = line.strip().partition(": [")
        if rest:
            numbers[name] = [float(word) for word in rest.rstrip("]").split(",")]
    np.testing.assert_allclose(numbers["translation"], -R_VELO_IMU.T @ T_VELO_IMU, atol=1e-6)
    np.testing.assert_allclose(numbers["rotation"], [0, 0, -np.sqrt(0.5), np.sqrt(0.5)], atol=1e-7)


def test_unsorted_repeated_and_missing_imu_packets(run_script, tmp_path):
    drive = write_drive(tmp_path)
    stamps = np.round(np.arange(0.5, 2.7, 0.01) * 1e9).astype(int)
    stamps = np.concatenate([stamps[:100], stamps[112:]])  # a gap of 0.13 s
    stamps[[60, 61]] = stamps[[61, 60]]
    stamps = np.insert(stamps, 150, stamps[149])
    write_oxts(drive.extract / "oxts", stamps)
    done = run_script("kitti_to_bag.py", "--drive", drive.sync, tmp_path / "o.bag")
    assert done.returncode == 0, done.stderr
    assert "1 oxts packets were out of order" in done.stdout
    assert "1 oxts packets repeated a stamp" in done.stdout
    assert "1 gaps over 0.05 s" in done.stdout and "0.130 s after" in done.stdout
    found = np.array([nanoseconds(m.header.stamp) for m in messages_by_topic(tmp_path / "o.bag")["/imu_raw"]])
    assert np.all(np.diff(found) > 0)
    assert np.diff(found).max() == 130_000_000


def test_bag_is_in_order_of_time(converted):
    from fdi_lio_scripts.bag_reading import open_bag

    with open_bag(str(converted[2] / "o.bag")) as bag:
        # a raw message is (type, bytes, md5, position in the file, class)
        offsets = [message[3] for _, message, _ in bag.read_messages(raw=True)]
    assert offsets == sorted(offsets)


def test_sequence_08_is_cut_at_frame_1100(run_script, tmp_path):
    drive = write_drive(tmp_path, range(1097, 1103), columns=8)
    done = run_script("kitti_to_bag.py", "--sequence", "08", "--raw-root", tmp_path, tmp_path / "08.bag")
    assert done.returncode == 0, done.stderr
    assert drive.sync.name.startswith(DRIVE)
    clouds = messages_by_topic(tmp_path / "08.bag")["/points_raw"]
    assert len(clouds) == 3
    assert nanoseconds(clouds[0].header.stamp) == START_NS + 2 * 10**9 + 1100 * 100_000_000
    assert "only frames 1100 .. 1102 of 1100 .. 5170 exist" in done.stdout


def test_sequence_table():
    assert (SEQUENCES["00"].drive, SEQUENCES["00"].last_frame) == ("2011_10_03_drive_0027", 4540)
    assert sequence_range("7").drive == "2011_09_30_drive_0027"
    assert sequence_range("08").first_frame == 1100 and sequence_range("08").date == DATE


def test_odometry_poses_become_poses_of_the_lidar(run_script, tmp_path):
    drive = write_drive(tmp_path)
    # The camera moves 1 m forward (its z) each frame: so does the lidar (its x).
    poses = [f"1 0 0 0 0 1 0 0 0 0 1 {i}" for i in range(5)]
    (tmp_path / "07.txt").write_text("\n".join(poses))
    done = run_script(
        "kitti_to_bag.py", "--drive", drive.sync, tmp_path / "o.bag", "--poses", tmp_path / "07.txt"
    )
    assert done.returncode == 0, done.stderr
    rows = np.loadtxt(tmp_path / "o_lidar.tum")
    np.testing.assert_allclose(rows[:, 1:4], [[i, 0, 0] for i in range(5)], atol=1e-9)
    np.testing.assert_allclose(rows[:, 0], START_NS * 1e-9 + 2.05 + 0.1 * np.arange(5), atol=1e-6)


def test_plain_folder_of_bin_and_xz_files(run_script, tmp_path):
    folder = tmp_path / "scans"
    folder.mkdir()
    scan = scan_points(columns=16)
    scan.tofile(folder / "0000000000.bin")
    (folder / "0000000002.bin.xz").write_bytes(lzma.compress(scan.tobytes()))
    done = run_script("kitti_to_bag.py", "--clouds", folder, "--rate", "20", tmp_path / "o.bag", "--no-time",
                      "--intensity-scale", "255")
    assert done.returncode == 0, done.stderr
    found = messages_by_topic(tmp_path / "o.bag")
    assert list(found) == ["/points_raw"]
    first, second = found["/points_raw"]
    assert [field.name for field in first.fields] == ["x", "y", "z", "intensity", "ring"]
    assert first.point_step == 18
    # frame 1 is missing, which must not shift frame 2
    assert nanoseconds(second.header.stamp) - nanoseconds(first.header.stamp) == 100_000_000
    intensity = np.ndarray(first.width, "<f4", bytes(first.data), 12, 18)
    np.testing.assert_allclose(intensity, 255 * scan[:, 3], rtol=1e-6)


def test_real_scans(run_script, shared_data, tmp_path):
    folder = shared_data / "kitti_2011_09_26"
    done = run_script("kitti_to_bag.py", "--clouds", folder, "--frames", 0, 1, tmp_path / "o.bag")
    assert done.returncode == 0, done.stderr
    clouds = messages_by_topic(tmp_path / "o.bag")["/points_raw"]
    assert [cloud.width for cloud in clouds] == [114278, clouds[1].width]
    points = cloud_points(clouds[0])
    assert set(points["ring"]) == set(range(64))
    raw = np.frombuffer(lzma.decompress((folder / "0000000000.bin.xz").read_bytes()), "<f4").reshape(-1, 4)
    np.testing.assert_array_equal(points["x"], raw[:, 0])
    assert 0 <= points["time"].min() and points["time"].max() <= 0.1


def bad_drive(tmp_path, spoil):
    drive = write_drive(tmp_path, columns=8)
    spoil(drive)
    return ["--drive", drive.sync, tmp_path / "o.bag"]


@pytest.mark.parametrize("spoil, words", [
    (lambda d: (d.extract / "oxts" / "timestamps.txt").unlink(), ["_extract", "--no-imu"]),
    (
        lambda d: (d.extract / "oxts" / "data" / "0000000007.txt").write_text("1 2 3\n"),
        ["0000000007.txt", "3 values"],
    ),
    (
        lambda d: (d.extract / "oxts" / "data" / "0000000007.txt").write_text("x\n"),
        ["0000000007.txt", "no number"],
    ),
    (
        lambda d: (d.sync / "velodyne_points" / "data" / "0000000002.bin").write_bytes(b"12345"),
        ["0000000002.bin", "5 bytes"],
    ),
    (lambda d: (d.sync / "velodyne_points" / "timestamps_end.txt").unlink(), ["timestamps_end.txt"]),
    (
        lambda d: (d.sync / "velodyne_points" / "timestamps.txt").write_text("nonsense\n"),
        ["line 1", "nonsense"],
    ),
    (lambda d: [f.unlink() for f in (d.sync / "velodyne_points" / "data").iterdir()], ["holds no scans"]),
    (lambda d: (d.sync.parent / "calib_imu_to_velo.txt").write_text("R: 1 2\n"), ["calib_imu_to_velo.txt"]),
])
def test_broken_drives_are_explained(run_script, tmp_path, spoil, words):
    done = run_script("kitti_to_bag.py", *bad_drive(tmp_path, spoil))
    assert done.returncode == 2 and "Traceback" not in done.stderr
    for word in words:
        assert word in done.stderr


def test_lost_frames_are_left_out_and_noted(run_script, tmp_path):
    drive = write_drive(tmp_path, columns=8)
    stamps = drive.sync / "velodyne_points" / "timestamps_start.txt"
    lines = stamps.read_text().splitlines()
    lines[3] = ""
    stamps.write_text("\n".join(lines) + "\n")
    (drive.sync / "velodyne_points" / "data" / "0000000001.bin").unlink()
    done = run_script("kitti_to_bag.py", "--drive", drive.sync, tmp_path / "o.bag")
    assert done.returncode == 0, done.stderr
    assert "1 scans have no time stamp" in done.stdout and "1 scans are missing" in done.stdout
    assert len(messages_by_topic(tmp_path / "o.bag")["/points_raw"]) == 3


@pytest.mark.parametrize("arguments, words", [
    (["--sequence", "03", "--raw-root", "."], ["withdrawn"]),
    (["--sequence", "15", "--raw-root", "."], ["00 to 10"]),
    (["--sequence", "07", "--raw-root", "/nowhere"], ["/nowhere/2011_09_30/2011_09_30_drive_0027_sync"]),
    (["--clouds", "/nowhere"], ["/nowhere"]),
])
def test_wrong_sources_are_explained(run_script, tmp_path, arguments, words):
    done = run_script("kitti_to_bag.py", *arguments, tmp_path / "o.bag")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    for word in words:
        assert word in done.stderr


def test_existing_bag_is_not_replaced_unasked(run_script, tmp_path):
    arguments = ["--drive", write_drive(tmp_path, columns=8).sync, tmp_path / "o.bag"]
    (tmp_path / "o.bag").write_text("precious")
    done = run_script("kitti_to_bag.py", *arguments)
    assert done.returncode == 2 and "--overwrite" in done.stderr
    assert (tmp_path / "o.bag").read_text() == "precious"
    assert run_script("kitti_to_bag.py", *arguments, "--overwrite").returncode == 0
    assert not (tmp_path / "o.bag.active").exists()
