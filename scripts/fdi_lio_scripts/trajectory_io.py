"""Reads trajectories from TUM and KITTI text files and from ROS bags, and writes TUM files."""

from pathlib import Path
from typing import List, Optional, Tuple

import numpy as np

from . import rotations
from .bag_reading import open_bag, topics_of_types
from .errors import UserError
from .trajectory import Trajectory, checked

TUM_COLUMNS = 8
KITTI_COLUMNS = 12
BAG_MAGIC = b"#ROSBAG V"
POSE_TYPES = ("nav_msgs/Odometry", "geometry_msgs/PoseStamped", "geometry_msgs/TransformStamped")
SECONDS_PER_UNIT = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def read_trajectory(
    path: str,
    topic: Optional[str] = None,
    kitti_times: Optional[str] = None,
    kitti_rate_hz: float = 10.0,
    stamp_unit: str = "s",
    sort: bool = False,
) -> Trajectory:
    """Reads a trajectory whose format is recognised from its content.

    topic: of a bag; may be left out when only one topic has poses.
    kitti_times: file with one stamp in seconds a line; without it row i of a KITTI file is at i /
    kitti_rate_hz.
    stamp_unit: of the stamps in a TUM file ("s", "ms", "us", "ns").
    """
    file = Path(path)
    if not file.is_file():
        raise UserError(f"{path}: no such file: check the path")
    if is_bag(file):
        rows, places = _read_bag(path, topic)
    else:
        rows, places = _read_text(file, kitti_times, kitti_rate_hz)
        if rows.size:
            rows[:, 0] *= SECONDS_PER_UNIT[stamp_unit]
    return checked(path, rows, places, sort)


def is_bag(file: Path) -> bool:
    """True if the file starts as ROS bags do."""
    with file.open("rb") as stream:
        return stream.read(len(BAG_MAGIC)) == BAG_MAGIC


def write_tum(
    path: str, stamps_ns: np.ndarray, positions: np.ndarray, quaternions: np.ndarray, comment: str
) -> None:
    """Writes `stamp tx ty tz qx qy qz qw`; stamps are integer nanoseconds, so that none of their digits is
    lost.
    """
    with open(path, "w", encoding="utf-8") as stream:
        stream.write(f"# {comment}\n# stamp[s] tx ty tz[m] qx qy qz qw\n")
        for stamp, t, q in zip(stamps_ns.tolist(), positions.tolist(), quaternions.tolist()):
            seconds, nanoseconds = divmod(stamp, 10**9)
            values = " ".join(f"{value:.9f}" for value in t + q)
            stream.write(f"{seconds}.{nanoseconds:09d} {values}\n")


def pose_rows_of_kitti(matrices: np.ndarray, stamps: np.ndarray) -> np.ndarray:
    """Rows `stamp x y z qx qy qz qw` of N x 12 KITTI rows (3x4 matrices [R | t], row by row)."""
    poses = matrices.reshape(-1, 3, 4)
    return np.column_stack([stamps, poses[:, :, 3], rotations.from_matrices(poses[:, :, :3])])


def read_numbers(file: Path) -> Tuple[np.ndarray, np.ndarray]:
    """The numbers of a text file (blank or comma between them, # comments) and the line number of each row.
    """
    rows: List[List[float]] = []
    places: List[int] = []
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        raise UserError(f"{file}: is neither text nor a ROS bag: give a TUM, KITTI or bag file") from None
    for number, line in enumerate(lines, start=1):
        words = line.split("#", 1)[0].replace(",", " ").split()
        if not words:
            continue
        try:
            rows.append([float(word) for word in words])
        except ValueError:
            raise UserError(f"{file}: line {number} is no row of numbers: '{line.strip()[:60]}'") from None
        places.append(number)
        if len(rows[-1]) != len(rows[0]):
            raise UserError(
                f"{file}: line {number} has {len(rows[-1])} numbers where line {places[0]} has "
                f"{len(rows[0])}: "
                "the file may be cut short; remove or mend that line"
            )
    return np.array(rows, dtype=float), np.array(places)


def _read_text(file: Path, kitti_times: Optional[str], rate_hz: float) -> Tuple[np.ndarray, np.ndarray]:
    """Rows of a TUM or KITTI file, told apart by the number of columns."""
    numbers, places = read_numbers(file)
    if len(numbers) == 0:
        raise UserError(f"{file}: holds no poses: check that the run wrote any")
    columns = numbers.shape[1]
    if columns == TUM_COLUMNS:
        return numbers, places
    if columns != KITTI_COLUMNS:
        raise UserError(
            f"{file}: has {columns} columns: TUM has 8 (stamp tx ty tz qx qy qz qw), KITTI has 12 (3x4 "
            "matrix)"
        )
    stamps = np.arange(len(numbers)) / rate_hz
    if kitti_times is not None:
        times, _ = read_numbers(Path(kitti_times))
        if times.size != len(numbers):
            raise UserError(
                f"{kitti_times}: has {times.size} times for {len(numbers)} poses of {file}: they must match"
            )
        stamps = times.reshape(-1)
    if not np.isfinite(numbers).all():
        bad = places[np.flatnonzero(~np.isfinite(numbers).all(axis=1))[0]]
        raise UserError(
            f"{file}: the pose at line {bad} is NaN or infinite: remove it or find out why it failed"
        )
    determinants = np.linalg.det(numbers.reshape(-1, 3, 4)[:, :, :3])
    if np.abs(determinants - 1.0).max() > 0.01:
        bad = places[int(np.argmax(np.abs(determinants - 1.0)))]
        raise UserError(
            f"{file}: line {bad} holds no rotation matrix: KITTI rows are r11 r12 r13 tx r21 ... tz"
        )
    return pose_rows_of_kitti(numbers, stamps), places


def _read_bag(path: str, topic: Optional[str]) -> Tuple[np.ndarray, np.ndarray]:
    """Rows of a topic with poses. The stamps are those of the headers, not the times of recording."""
    with open_bag(path) as bag:
        topics = topics_of_types(bag, POSE_TYPES)
        if topic is None:
            if len(topics) != 1:
                found = ", ".join(topics) if topics else "none"
                raise UserError(
                    f"{path}: has {len(topics)} topics with poses ({found}): choose one with --topic"
                )
            topic = topics[0]
        elif topic not in topics:
            found = ", ".join(topics) if topics else "none"
            raise UserError(f"{path}: topic {topic} has no poses; topics that have: {found}")
        rows = [_pose_of_message(message) for _, message, _ in bag.read_messages(topics=[topic])]
    return np.array(rows, dtype=float).reshape(-1, TUM_COLUMNS), np.arange(1, len(rows) + 1)


def _pose_of_message(message: object) -> List[float]:
    """`stamp x y z qx qy qz qw` of an Odometry, PoseStamped or TransformStamped message."""
    if hasattr(message, "transform"):
        t, q = message.transform.translation, message.transform.rotation
    else:
        # Odometry wraps the pose in a PoseWithCovariance
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        t, q = pose.position, pose.orientation
    return [message.header.stamp.to_sec(), t.x, t.y, t.z, q.x, q.y, q.z, q.w]
