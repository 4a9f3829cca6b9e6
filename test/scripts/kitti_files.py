"""Writes small recordings in the exact layout of KITTI's raw data."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import List

import numpy as np

from fdi_lio_scripts.hdl64 import BEAM_ELEVATIONS_DEG

DATE, DRIVE = "2011_09_30", "2011_09_30_drive_0028"
START = datetime(2011, 9, 30, 12, 50, 36)
START_NS = int(np.datetime64("2011-09-30T12:50:36", "ns").astype(np.int64))
R_VELO_IMU = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])  # a quarter turn about z
T_VELO_IMU = np.array([-0.8, 0.3, -0.8])


def stamp_line(nanoseconds_from_start: int) -> str:
    """A line of KITTI's timestamps.txt."""
    seconds, rest = divmod(nanoseconds_from_start, 10**9)
    return (START + timedelta(seconds=seconds)).strftime("%Y-%m-%d %H:%M:%S") + f".{rest:09d}"


def scan_points(range_m: float = 20.0, columns: int = 360) -> np.ndarray:
    """One scan in KITTI's order: rings from the top, each counter-clockwise from straight ahead."""
    azimuth = np.radians((np.arange(columns) + 0.5) * 360.0 / columns)
    elevation = np.radians(BEAM_ELEVATIONS_DEG)[:, None]
    x = range_m * np.cos(elevation) * np.cos(azimuth)
    y = range_m * np.cos(elevation) * np.sin(azimuth)
    z = range_m * np.sin(elevation) + 0 * azimuth
    reflectance = np.round(np.linspace(0, 0.99, columns), 2) + 0 * elevation
    return np.stack([x, y, z, reflectance], axis=-1).reshape(-1, 4).astype(np.float32)


def oxts_row(seconds: float) -> List[float]:
    """30 values of a car that drives east at 10 m/s on level ground, turning at 0.1 rad/s (all made up but
    valid).
    """
    row = np.zeros(30)
    row[0] = 49.0
    row[1] = 8.4 + np.degrees(10.0 * seconds / (6378137.0 * np.cos(np.radians(49.0))))
    row[2] = 115.0 + 0.5 * seconds
    row[5] = 0.1 * seconds  # yaw
    row[11:14] = [0.25, 1.0, 9.81 + 0.001 * seconds]
    row[14:17] = 77.0  # af al au must not be taken for ax ay az
    row[17:20] = [0.01, -0.02, 0.1]
    row[20:23] = 88.0
    row[23] = 0.05
    row[26] = 9
    return row.tolist()


@dataclass
class RawDrive:
    """Folders of a written drive."""

    root: Path

    @property
    def sync(self) -> Path:
        return self.root / DATE / f"{DRIVE}_sync"

    @property
    def extract(self) -> Path:
        return self.root / DATE / f"{DRIVE}_extract"


def write_drive(root: Path, frames: range = range(5), columns: int = 360) -> RawDrive:
    """Scans at 10 Hz, 100 Hz oxts in `_extract` from 1.5 s before the first scan, and the calibration of the
    day.
    """
    drive = RawDrive(root)
    velodyne = drive.sync / "velodyne_points"
    (velodyne / "data").mkdir(parents=True)
    count = frames.stop
    for frame in frames:
        scan_points(columns=columns).tofile(velodyne / "data" / f"{frame:010d}.bin")
    for name, offset_ns in (
        ("timestamps_start", 0), ("timestamps", 50_000_000), ("timestamps_end", 100_000_000)
    ):
        lines = [stamp_line(2 * 10**9 + 100_000_000 * i + offset_ns) for i in range(count)]
        (velodyne / f"{name}.txt").write_text("\n".join(lines) + "\n")
    last_s = 2 + 0.1 * count + 0.2
    write_oxts(drive.extract / "oxts", np.round(np.arange(0.5, last_s, 0.01) * 1e9).astype(int))
    write_oxts(drive.sync / "oxts", [2 * 10**9 + 100_000_000 * i for i in range(count)])
    day = root / DATE
    words = " ".join(f"{v:.6e}" for v in R_VELO_IMU.reshape(-1))
    (day / "calib_imu_to_velo.txt").write_text(
        f"calib_time: 25-May-2012 16:47:16\nR: {words}\nT: " + " ".join(f"{v:.6e}" for v in T_VELO_IMU) + "\n"
    )
    (day / "calib_velo_to_cam.txt").write_text(
        "calib_time: 15-Mar-2012 11:45:23\nR: 0 -1 0 0 0 -1 1 0 0\nT: 0.0 -0.1 -0.3\ndelta_f: 0 0\n"
    )
    (day / "calib_cam_to_cam.txt").write_text(
        "calib_time: 09-Jan-2012 14:00:15\ncorner_dist: 9.95e-02\nR_rect_00: 1 0 0 0 1 0 0 0 1\n"
    )
    return drive


def write_oxts(folder: Path, stamps_from_start_ns) -> None:
    """oxts packets in the given order of file names; the content follows the stamp."""
    (folder / "data").mkdir(parents=True, exist_ok=True)
    lines = []
    for index, stamp in enumerate(stamps_from_start_ns):
        lines.append(stamp_line(int(stamp)))
        words = " ".join(repr(value) for value in oxts_row(int(stamp) * 1e-9))
        (folder / "data" / f"{index:010d}.txt").write_text(words + "\n")
    (folder / "timestamps.txt").write_text("\n".join(lines) + "\n")
