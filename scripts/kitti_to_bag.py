#!/usr/bin/python3
"""Makes a ROS bag of a KITTI raw drive, an odometry sequence, or a plain folder of scans.

  kitti_to_bag.py --sequence 07 --raw-root ~/kitti 07.bag     (drive and frames of odometry sequence 07)
  kitti_to_bag.py --drive ~/kitti/2011_09_30/2011_09_30_drive_0027_sync 0027.bag
  kitti_to_bag.py --clouds ~/scans --rate 10 scans.bag        (.bin or .bin.xz files: lidar only)

Clouds come from the `_sync` folder (they are not motion-corrected there) with ring and time of each point;
the 100 Hz IMU comes from `_extract`, sorted, without repeated stamps. Topics: /points_raw (stamped with the
start of the sweep), /imu_raw, /gps/fix. Beside OUT.bag the ground truth of the IMU is written as OUT_imu.tum:
x east, y north, z up in metres from the first packet. docs/evaluation.md says how times and rings are found
and how the truth is made.
"""

import argparse
from collections import Counter
from pathlib import Path
from typing import Iterator, List, Optional, Tuple

import numpy as np

from fdi_lio_scripts import errors, kitti_messages, kitti_raw, rotations
from fdi_lio_scripts.bag_writing import BagWriter
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.kitti_drive import Recording, plain_folder, raw_drive
from fdi_lio_scripts.kitti_sequences import sequence_range
from fdi_lio_scripts.progress import Progress
from fdi_lio_scripts.trajectory_io import KITTI_COLUMNS, read_numbers, write_tum

POINTS_TOPIC, IMU_TOPIC, FIX_TOPIC = "/points_raw", "/imu_raw", "/gps/fix"
REPORTED_GAP_S = 0.05
LISTED_GAPS = 10
FIX_PERIOD_NS = 100_000_000  # the RT3003's position is smooth; 10 Hz is what a GNSS receiver would give


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "--sequence", metavar="NN", help="odometry sequence 00 .. 10 (03 has no raw data); needs --raw-root"
    )
    source.add_argument("--drive", type=Path, metavar="DIR", help="a ..._sync folder")
    source.add_argument("--clouds", type=Path, metavar="DIR", help="a folder of NNNNNNNNNN.bin or .bin.xz")
    parser.add_argument("output", help="the bag to write")
    parser.add_argument(
        "--raw-root", type=Path, metavar="DIR", help="folder that holds 2011_09_26, 2011_09_30, ..."
    )
    parser.add_argument(
        "--extract", type=Path, metavar="DIR", help="the ..._extract folder, if it is not beside ..._sync"
    )
    parser.add_argument(
        "--frames", type=int, nargs=2, metavar=("FIRST", "LAST"), help="frames to take, both included"
    )
    parser.add_argument("--rate", type=float, default=10.0, metavar="HZ", help="of the scans of --clouds")
    parser.add_argument(
        "--no-imu", action="store_true", help="go without the 100 Hz IMU of the _extract folder"
    )
    parser.add_argument(
        "--no-time", action="store_true", help="leave out the field `time` (to test systems without it)"
    )
    parser.add_argument(
        "--counter-clockwise", action="store_true", help="the head turns the other way (see the docs)"
    )
    parser.add_argument(
        "--intensity-scale", type=float, default=1.0, metavar="F", help="KITTI has 0..1, drivers 0..255"
    )
    parser.add_argument(
        "--poses", type=Path, metavar="FILE",
        help="the odometry benchmark's NN.txt: also writes OUT_lidar.tum"
    )
    parser.add_argument("--compression", choices=("none", "lz4", "bz2"), default="none")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing bag")
    arguments = parser.parse_args()
    if arguments.sequence and not arguments.raw_root:
        parser.error("--sequence needs --raw-root")
    if not 0.1 <= arguments.rate <= 100:
        parser.error("--rate must lie in 0.1 .. 100 Hz")
    return arguments


def open_recording(arguments: argparse.Namespace) -> Recording:
    """The recording that the command line names."""
    frames: Optional[Tuple[int, int]] = tuple(arguments.frames) if arguments.frames else None
    if arguments.clouds:
        return plain_folder(arguments.clouds, arguments.rate, frames)
    drive = arguments.drive
    if arguments.sequence:
        chosen = sequence_range(arguments.sequence)
        drive = arguments.raw_root / chosen.date / f"{chosen.drive}_sync"
        frames = frames or (chosen.first_frame, chosen.last_frame)
        print(f"sequence {arguments.sequence.zfill(2)}: {chosen.drive}, frames {frames[0]} .. {frames[1]}")
    return raw_drive(drive, frames, arguments.extract, arguments.no_imu)


def events(recording: Recording) -> Iterator[Tuple[int, str, int]]:
    """(stamp in ns, topic, index) of all messages in order of time, so that the bag plays back without
    seeking.
    """
    listed: List[Tuple[int, str, int]] = [
        (s.start_ns, POINTS_TOPIC, i) for i, s in enumerate(recording.scans)
    ]
    if recording.oxts is not None:
        next_fix_ns = 0
        for index, stamp in enumerate(recording.oxts.stamps_ns.tolist()):
            if recording.oxts_is_imu:
                listed.append((stamp, IMU_TOPIC, index))
            if stamp >= next_fix_ns:
                listed.append((stamp, FIX_TOPIC, index))
                next_fix_ns = stamp + FIX_PERIOD_NS - FIX_PERIOD_NS // 20  # stamps jitter by less than 5 ms
    return iter(sorted(listed))


def write_bag(recording: Recording, arguments: argparse.Namespace) -> Counter:
    """Writes all messages and returns how the rings of the scans were found."""
    ways: Counter = Counter()
    layout = kitti_messages.CloudOptions(
        with_time=not arguments.no_time,
        clockwise=not arguments.counter_clockwise,
        intensity_scale=arguments.intensity_scale,
    )
    oxts = recording.oxts
    turned = kitti_messages.quaternions(oxts) if oxts is not None else None
    with BagWriter(arguments.output, arguments.overwrite, arguments.compression) as bag, Progress(
        len(recording.scans), "scans"
    ) as progress:
        for stamp, topic, index in events(recording):
            if topic == IMU_TOPIC:
                message = kitti_messages.imu_message(stamp, oxts.values[index], turned[index])
            elif topic == FIX_TOPIC:
                message = kitti_messages.fix_message(stamp, oxts.values[index])
            else:
                scan = recording.scans[index]
                points, how = kitti_messages.structured_points(
                    kitti_raw.read_scan(scan.file), scan.sweep_s, layout
                )
                ways[how] += 1
                message = kitti_messages.scan_message(points, stamp)
                progress.step()
            bag.write(topic, message, stamp)
    return ways


def write_imu_truth(recording: Recording, path: str) -> None:
    """The poses T_enu_imu of the oxts packets as a TUM file."""
    oxts = recording.oxts
    positions = kitti_raw.mercator_positions(oxts)
    write_tum(path, oxts.stamps_ns, positions, kitti_messages.quaternions(oxts),
              "KITTI oxts: pose of the IMU, x east y north z up from the first packet")
    print(f"wrote {path}: ground truth of the IMU, {len(positions)} poses")


def write_lidar_truth(recording: Recording, poses_file: Path, path: str) -> None:
    """The odometry benchmark's poses as poses of the lidar, in the frame of the first lidar pose.

    The file holds T_cam0_cam of the rectified camera 0; with T_cam_lidar = R_rect_00 T_velo_to_cam the
    lidar's pose is T_cam_lidar^-1 T_cam0_cam T_cam_lidar. Each belongs to the time when the head looked
    forward.
    """
    if not poses_file.is_file():
        raise UserError(f"{poses_file}: no such file: check the path")
    numbers, _ = read_numbers(poses_file)
    if numbers.ndim != 2 or numbers.shape[1] != KITTI_COLUMNS:
        raise UserError(f"{poses_file}: is no file of KITTI poses (12 numbers a line)")
    if len(numbers) != len(recording.scans):
        raise UserError(
            f"{poses_file}: has {len(numbers)} poses for {len(recording.scans)} scans: is it this sequence's?"
        )
    folder = recording.calibration_folder
    rectification = kitti_raw.read_calibration(folder / "calib_cam_to_cam.txt").get("R_rect_00", np.empty(0))
    if rectification.size != 9:
        raise UserError(f"{folder / 'calib_cam_to_cam.txt'}: has no R_rect_00 (9 numbers)")
    turn = np.eye(4)
    turn[:3, :3] = rectification.reshape(3, 3)
    T_cam_lidar = turn @ kitti_raw.rigid_transform(folder / "calib_velo_to_cam.txt")
    T_cam0_cam = np.tile(np.eye(4), (len(numbers), 1, 1))
    T_cam0_cam[:, :3] = numbers.reshape(-1, 3, 4)
    T_lidar0_lidar = np.linalg.inv(T_cam_lidar) @ T_cam0_cam @ T_cam_lidar
    stamps = np.array([scan.forward_ns for scan in recording.scans])
    write_tum(path, stamps, T_lidar0_lidar[:, :3, 3], rotations.from_matrices(T_lidar0_lidar[:, :3, :3]),
              "KITTI odometry: pose of the lidar, from its first pose")
    print(f"wrote {path}: ground truth of the lidar, {len(numbers)} poses")


def print_extrinsic(folder: Path) -> None:
    """T_imu_lidar for the yaml file, from calib_imu_to_velo.txt (p_lidar = R p_imu + T)."""
    file = folder / "calib_imu_to_velo.txt"
    if not file.is_file():
        print(f"note: {file} is missing, so T_imu_lidar is unknown: unpack the calibration of the day there")
        return
    T_imu_lidar = np.linalg.inv(kitti_raw.rigid_transform(file))
    translation = ", ".join(f"{value:.6f}" for value in T_imu_lidar[:3, 3])
    rotation = ", ".join(f"{value:.8f}" for value in rotations.from_matrices(T_imu_lidar[None, :3, :3])[0])
    print(f"  T_imu_lidar:    # of {file}\n    translation: [{translation}]\n    rotation: [{rotation}]")


def print_gaps(oxts: kitti_raw.Oxts) -> None:
    """Gaps of the 100 Hz IMU that a system has to bridge."""
    gaps = oxts.gaps(REPORTED_GAP_S)
    if not gaps:
        print(f"IMU: {len(oxts.stamps_ns)} packets, no gap over {REPORTED_GAP_S} s")
        return
    print(f"IMU: {len(oxts.stamps_ns)} packets, {len(gaps)} gaps over {REPORTED_GAP_S} s:")
    for stamp, length in gaps[:LISTED_GAPS]:
        print(
            f"  {length:.3f} s after {stamp / 1e9:.3f} ({(stamp - oxts.stamps_ns[0]) / 1e9:.2f} s from the "
            "start)"
        )
    if len(gaps) > LISTED_GAPS:
        print(
            f"  and {len(gaps) - LISTED_GAPS} more, the longest of all "
            f"{max(length for _, length in gaps):.3f} s"
        )


def main() -> int:
    """Reads the folders, writes the bag and the truth, reports."""
    arguments = parse_arguments()
    recording = open_recording(arguments)
    if arguments.poses and recording.calibration_folder is None:
        raise UserError("--poses needs the calibration of a raw drive: it does not go with --clouds")
    for note in recording.notes:
        print(f"note: {note}")
    if recording.oxts_is_imu:
        print_gaps(recording.oxts)
    ways = write_bag(recording, arguments)
    print(f"wrote {arguments.output}: {len(recording.scans)} scans; rings found by "
          + ", ".join(f"{way} ({count})" for way, count in ways.most_common()))
    stem = str(Path(arguments.output).with_suffix(""))
    if recording.oxts is not None:
        write_imu_truth(recording, f"{stem}_imu.tum")
    if arguments.poses:
        write_lidar_truth(recording, arguments.poses, f"{stem}_lidar.tum")
    if recording.calibration_folder is not None:
        print_extrinsic(recording.calibration_folder)
    return 0


if __name__ == "__main__":
    errors.run(main)
