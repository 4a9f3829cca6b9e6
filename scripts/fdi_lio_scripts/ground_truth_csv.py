"""Reads a table of poses with named or unnamed columns (SubT-MRS ground truth), keeping all digits of the
stamps.
"""

import csv
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Dict, List, Optional, Tuple

import numpy as np

from . import rotations
from .errors import UserError

STAMP_NAMES = (
    "timestamp", "stamp", "time", "t", "nsec", "nsecs", "ns", "sec", "secs", "header.stamp", "rosbagtimestamp"
)
POSE_NAMES = (
    ("x", "tx", "px", "p_x", "pos_x", "position.x", "pose.position.x", "pose.pose.position.x"),
    ("y", "ty", "py", "p_y", "pos_y", "position.y", "pose.position.y", "pose.pose.position.y"),
    ("z", "tz", "pz", "p_z", "pos_z", "position.z", "pose.position.z", "pose.pose.position.z"),
    ("qx", "q_x", "rot_x", "orientation.x", "pose.orientation.x", "pose.pose.orientation.x"),
    ("qy", "q_y", "rot_y", "orientation.y", "pose.orientation.y", "pose.pose.orientation.y"),
    ("qz", "q_z", "rot_z", "orientation.z", "pose.orientation.z", "pose.pose.orientation.z"),
    ("qw", "q_w", "rot_w", "orientation.w", "pose.orientation.w", "pose.pose.orientation.w"),
)
# Stamps at least this large are in that unit, since in seconds they would lie in the far future.
UNITS_NS = (
    (Decimal(10) ** 17, 1), (Decimal(10) ** 14, 10**3), (Decimal(10) ** 11, 10**6), (Decimal(0), 10**9)
)


def read_ground_truth_csv(path: str) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stamps in ns (sorted, without repeats), N x 3 positions in metres, N x 4 quaternions x y z w.

    Without a header the columns must be stamp x y z qx qy qz qw.
    """
    file = Path(path)
    if not file.is_file():
        raise UserError(f"{path}: no such file: check the path")
    lines = [line for line in file.read_text(encoding="utf-8-sig").splitlines() if line.strip()]
    if not lines:
        raise UserError(f"{path}: is empty: copy it again")
    delimiter = next((mark for mark in (",", ";", "\t") if mark in lines[0]), " ")
    rows = [
        [cell.strip() for cell in row] for row in csv.reader(
            lines, delimiter=delimiter, skipinitialspace=True
        )
    ]
    header: Optional[List[str]] = None
    if not _is_number(rows[0][0]):
        header = [name.strip().lstrip("#% ").lower().split("[")[0].split("(")[0].strip() for name in rows[0]]
        rows = rows[1:]
    columns = _columns(path, header, len(rows[0]) if rows else 0)
    stamps: List[int] = []
    poses: List[List[float]] = []
    for number, row in enumerate(rows, start=2 if header else 1):
        try:
            stamps.append(_nanoseconds(row, columns))
            poses.append([float(row[columns[name]]) for name in "x y z qx qy qz qw".split()])
        except (ValueError, IndexError, InvalidOperation):
            raise UserError(
                f"{path}: row {number} is no pose: '{','.join(row)[:60]}': mend or remove it"
            ) from None
    values = np.array(poses).reshape(-1, 7)
    lengths = np.linalg.norm(values[:, 3:], axis=1)
    if len(values) == 0 or not np.isfinite(values).all() or np.abs(lengths - 1).max() > 0.01:
        raise UserError(
            f"{path}: holds no poses, NaN, or quaternions whose length is not 1: check its columns"
        )
    unique, first_uses = np.unique(np.array(stamps, dtype=np.int64), return_index=True)
    return unique, values[first_uses, :3], rotations.normalised(values[first_uses, 3:])


def _is_number(text: str) -> bool:
    try:
        float(text)
        return True
    except ValueError:
        return False


def _columns(path: str, header: Optional[List[str]], width: int) -> Dict[str, int]:
    """Index of each needed column; "stamp", and "nsec" where seconds and nanoseconds are apart."""
    names = "x y z qx qy qz qw".split()
    if header is None:
        if width != 8:
            raise UserError(
                f"{path}: has {width} columns and no header: 8 are expected, stamp x y z qx qy qz qw"
            )
        return dict(zip(["stamp"] + names, range(8)))
    columns: Dict[str, int] = {}
    for name, accepted in zip(names, POSE_NAMES):
        found = [index for index, title in enumerate(header) if title in accepted]
        if not found:
            raise UserError(
                f"{path}: has no column for {name} (it has {', '.join(header)}): rename its header"
            )
        columns[name] = found[0]
    seconds = next(
        (i for i, title in enumerate(header) if title in ("sec", "secs", "header.stamp.secs")), None
    )
    rest = next(
        (i for i, title in enumerate(header) if title in ("nsec", "nsecs", "header.stamp.nsecs")), None
    )
    if seconds is not None and rest is not None:
        return {**columns, "stamp": seconds, "nsec": rest}
    stamp = next((index for index, title in enumerate(header) if title in STAMP_NAMES), None)
    if stamp is None:
        raise UserError(f"{path}: has no column of times (it has {', '.join(header)}): name it 'timestamp'")
    return {**columns, "stamp": stamp}


def _nanoseconds(row: List[str], columns: Dict[str, int]) -> int:
    """The stamp of a row. The unit follows from its size: seconds, ms, us or ns since 1970."""
    stamp = Decimal(row[columns["stamp"]])
    if "nsec" in columns:
        return int(stamp) * 10**9 + int(Decimal(row[columns["nsec"]]))
    factor = next(factor for limit, factor in UNITS_NS if stamp >= limit)
    return int((stamp * factor).to_integral_value())
