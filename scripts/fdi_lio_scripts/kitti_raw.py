"""Reads the folders of KITTI's raw data: time stamps, scans, oxts packets and calibration."""

import lzma
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Optional, Tuple

import numpy as np

from . import rotations
from .errors import UserError

OXTS_FIELDS = 30
# Columns of an oxts row (dataformat.txt of the raw data), counted from 0.
LAT, LON, ALT, ROLL, PITCH, YAW = range(6)
ACCELERATION = slice(11, 14)  # ax ay az: m/s^2 in the body frame (x forward, y left, z up), with gravity
ANGULAR_RATE = slice(17, 20)  # wx wy wz: rad/s about the same axes
POSITION_ACCURACY = 23  # m, north/east
SATELLITES = 26
POSITION_MODE = 27
EARTH_RADIUS_M = 6378137.0


def read_stamps(file: Path) -> List[Optional[int]]:
    """Nanoseconds since 1970 of each line `YYYY-MM-DD hh:mm:ss.nnnnnnnnn`; None for an empty line (a lost
    frame).

    The files give no time zone; the times are taken as UTC, which only shifts all streams together.
    """
    if not file.is_file():
        raise UserError(f"{file}: no such file: is the drive unpacked completely?")
    stamps: List[Optional[int]] = []
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1):
        text = line.strip()
        try:
            stamps.append(int(np.datetime64(text.replace(" ", "T"), "ns").astype(np.int64)) if text else None)
        except ValueError:
            raise UserError(f"{file}: line {number} is no time stamp: '{text[:40]}'") from None
    return stamps


def scan_files(folder: Path) -> Dict[int, Path]:
    """Scans by frame number: NNNNNNNNNN.bin, or .bin.xz."""
    files = {}
    for file in sorted(folder.glob("*.bin")) + sorted(folder.glob("*.bin.xz")):
        number = file.name.split(".", 1)[0]
        if number.isdigit():
            files.setdefault(int(number), file)
    if not files:
        raise UserError(f"{folder}: holds no scans (NNNNNNNNNN.bin or .bin.xz): check the path")
    return files


def read_scan(file: Path) -> np.ndarray:
    """N x 4 float32: x y z in metres in the lidar frame, reflectance 0..1."""
    try:
        data = lzma.decompress(file.read_bytes()) if file.suffix == ".xz" else file.read_bytes()
    except (lzma.LZMAError, EOFError):
        raise UserError(f"{file}: is no complete xz file: copy it again") from None
    if len(data) % 16:
        raise UserError(
            f"{file}: {len(data)} bytes are no whole number of points (16 bytes each): copy it again"
        )
    return np.frombuffer(data, dtype="<f4").reshape(-1, 4)


@dataclass(frozen=True)
class Oxts:
    """oxts packets in order of time, without repeated stamps."""

    stamps_ns: np.ndarray
    values: np.ndarray  # N x 30
    unsorted: int  # packets that came after a later one
    repeated: int  # packets dropped since their stamp was there already

    def gaps(self, longer_than_s: float) -> List[Tuple[int, float]]:
        """(stamp in ns, length in s) of the gaps."""
        steps = np.diff(self.stamps_ns) * 1e-9
        return [(int(self.stamps_ns[i]), float(steps[i])) for i in np.flatnonzero(steps > longer_than_s)]

    def between(self, first_ns: int, last_ns: int) -> "Oxts":
        """The packets in a time span."""
        kept = (self.stamps_ns >= first_ns) & (self.stamps_ns <= last_ns)
        return Oxts(self.stamps_ns[kept], self.values[kept], self.unsorted, self.repeated)


def read_oxts(folder: Path) -> Oxts:
    """Reads `folder`/timestamps.txt and `folder`/data/NNNNNNNNNN.txt."""
    stamps: List[int] = []
    rows: List[List[float]] = []
    for number, stamp in enumerate(read_stamps(folder / "timestamps.txt")):
        file = folder / "data" / f"{number:010d}.txt"
        if stamp is None or not file.is_file():
            continue
        try:
            row = [float(word) for word in file.read_text(encoding="utf-8").split()]
        except ValueError:
            raise UserError(f"{file}: holds something that is no number: copy it again") from None
        if len(row) != OXTS_FIELDS:
            raise UserError(f"{file}: has {len(row)} values instead of {OXTS_FIELDS}: copy it again")
        stamps.append(stamp)
        rows.append(row)
    if not rows:
        raise UserError(f"{folder}/data: holds no oxts packets: is the drive unpacked completely?")
    in_file_order = np.array(stamps, dtype=np.int64)
    # np.unique sorts and keeps the first packet of each stamp
    unique, first_uses = np.unique(in_file_order, return_index=True)
    return Oxts(
        stamps_ns=unique,
        values=np.array(rows)[first_uses],
        unsorted=int(np.sum(in_file_order < np.maximum.accumulate(in_file_order))),
        repeated=len(rows) - len(unique),
    )


def orientations(oxts: Oxts) -> np.ndarray:
    """N x 3 x 3 rotations R_enu_imu = Rz(yaw) Ry(pitch) Rx(roll); yaw is 0 towards the east."""
    return rotations.from_roll_pitch_yaw(*(oxts.values[:, column] for column in (ROLL, PITCH, YAW)))


def mercator_positions(oxts: Oxts, origin: Optional[np.ndarray] = None) -> np.ndarray:
    """N x 3 metres east, north, up from the first packet (or from `origin`: latitude, longitude, altitude).

    The Mercator projection of the KITTI development kit with scale s = cos(latitude of the origin):
    east = s r lon, north = s r ln tan(pi/4 + lat/2).
    """
    start = oxts.values[0, [LAT, LON, ALT]] if origin is None else origin
    scale = np.cos(np.radians(start[0]))

    def project(lat: np.ndarray, lon: np.ndarray) -> np.ndarray:
        east = scale * EARTH_RADIUS_M * np.radians(lon)
        north = scale * EARTH_RADIUS_M * np.log(np.tan(np.pi / 4 + np.radians(lat) / 2))
        return np.stack([east, north], axis=-1)

    flat = project(oxts.values[:, LAT], oxts.values[:, LON]) - project(start[0], start[1])
    return np.column_stack([flat, oxts.values[:, ALT] - start[2]])


def read_calibration(file: Path) -> Dict[str, np.ndarray]:
    """`name: numbers` lines of a KITTI calibration file; lines that hold text (the date) are left out."""
    if not file.is_file():
        raise UserError(f"{file}: no such file: unpack the calibration of the day beside the drives")
    entries = {}
    for line in file.read_text(encoding="utf-8").splitlines():
        name, _, text = line.partition(":")
        try:
            entries[name.strip()] = np.array([float(word) for word in text.split()])
        except ValueError:
            continue
    return entries


def rigid_transform(file: Path) -> np.ndarray:
    """The 4x4 matrix of a calibration file with R and T: p_second = R p_first + T for
    calib_first_to_second.txt.
    """
    entries = read_calibration(file)
    if entries.get("R", np.empty(0)).size != 9 or entries.get("T", np.empty(0)).size != 3:
        raise UserError(
            f"{file}: has no R (9 numbers) and T (3 numbers): is it a KITTI raw calibration file?"
        )
    matrix = np.eye(4)
    matrix[:3, :3] = entries["R"].reshape(3, 3)
    matrix[:3, 3] = entries["T"]
    return matrix
