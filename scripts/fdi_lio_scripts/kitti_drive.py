"""Collects the parts of one recording: which scans, at which times, and which oxts packets belong to it."""

from dataclasses import dataclass
from pathlib import Path
from typing import List, Optional, Tuple

from . import kitti_raw
from .errors import UserError

NANOSECONDS = 10**9
# Packets this long before the first scan are kept, so that a system can initialise on them.
IMU_LEAD_NS = NANOSECONDS
# A sweep lasts about 0.1 s (the head turns at 10 Hz). What lies outside of this is a broken stamp.
SWEEP_RANGE_S = (0.05, 0.15)
NOMINAL_SWEEP_S = 0.1
# clocks that start at 0 look broken to many tools
FIRST_STAMP_OF_PLAIN_FOLDERS_NS = 1_000_000_000 * NANOSECONDS


@dataclass(frozen=True)
class Scan:
    """One sweep: its file, when it began, how long it took, and when the head looked forward."""

    file: Path
    start_ns: int
    sweep_s: float
    forward_ns: int


@dataclass(frozen=True)
class Recording:
    """Scans in order of time; oxts packets (100 Hz or 10 Hz) where they exist; notes for the user."""

    scans: List[Scan]
    oxts: Optional[kitti_raw.Oxts]
    oxts_is_imu: bool
    calibration_folder: Optional[Path]
    notes: List[str]


def plain_folder(folder: Path, rate_hz: float, frames: Optional[Tuple[int, int]]) -> Recording:
    """A folder of .bin files without any times: a sweep every 1 / rate_hz seconds."""
    files = _chosen(kitti_raw.scan_files(folder), frames, folder)
    first = files[0][0]
    scans = []
    for number, file in files:
        start_ns = FIRST_STAMP_OF_PLAIN_FOLDERS_NS + round((number - first) * NANOSECONDS / rate_hz)
        scans.append(Scan(file, start_ns, 1.0 / rate_hz, start_ns + round(0.5 * NANOSECONDS / rate_hz)))
    return Recording(
        scans, None, False, None, ["no time stamps, no IMU: scans are stamped at the given rate"]
    )


def raw_drive(
    sync: Path, frames: Optional[Tuple[int, int]], extract: Optional[Path], without_imu: bool
) -> Recording:
    """A drive of the raw data: scans from `_sync`, the 100 Hz oxts from `_extract` (beside it unless given).
    """
    if not sync.is_dir():
        raise UserError(f"{sync}: no such folder: download and unpack this drive (synced+rectified data)")
    notes: List[str] = []
    scans = _timed_scans(sync / "velodyne_points", frames, notes)
    extract = extract or sync.with_name(sync.name.replace("_sync", "_extract"))
    if without_imu:
        oxts = kitti_raw.read_oxts(sync / "oxts") if (sync / "oxts" / "timestamps.txt").is_file() else None
    elif extract == sync or not (extract / "oxts" / "timestamps.txt").is_file():
        raise UserError(
            f"{extract}/oxts: not found: the 100 Hz IMU is in the 'unsynced+unrectified' (_extract) archive "
            "of the drive: "
            "unpack it there, name it with --extract, or give --no-imu"
        )
    else:
        oxts = kitti_raw.read_oxts(extract / "oxts")
    if oxts is not None:
        notes += _oxts_notes(oxts)
        oxts = oxts.between(
            scans[0].start_ns - IMU_LEAD_NS, scans[-1].start_ns + round(scans[-1].sweep_s * NANOSECONDS)
        )
        if len(oxts.stamps_ns) == 0:
            raise UserError(f"{extract} and {sync}: their times do not overlap: are they of the same drive?")
    return Recording(scans, oxts, oxts is not None and not without_imu, sync.parent, notes)


def _chosen(files: dict, frames: Optional[Tuple[int, int]], folder: Path) -> List[Tuple[int, Path]]:
    """The files inside the frame range, by number."""
    numbers = sorted(files)
    if frames is not None:
        numbers = [number for number in numbers if frames[0] <= number <= frames[1]]
        if not numbers:
            raise UserError(
                f"{folder}: has frames {min(files)} .. {max(files)}, none of them in {frames[0]} .. "
                f"{frames[1]}"
            )
    return [(number, files[number]) for number in numbers]


def _timed_scans(folder: Path, frames: Optional[Tuple[int, int]], notes: List[str]) -> List[Scan]:
    """Scans with the times of their sweeps. Frames without a file or a stamp are left out and noted."""
    files = _chosen(kitti_raw.scan_files(folder / "data"), frames, folder / "data")
    starts, ends, forwards = (
        kitti_raw.read_stamps(folder / name) for name in (
            "timestamps_start.txt", "timestamps_end.txt", "timestamps.txt"
        )
    )
    scans: List[Scan] = []
    lost: List[int] = []
    odd_sweeps = 0
    for number, file in files:
        stamps = [rows[number] if number < len(rows) else None for rows in (starts, ends, forwards)]
        if any(stamp is None for stamp in stamps):
            lost.append(number)
            continue
        start_ns, end_ns, forward_ns = stamps
        sweep_s = (end_ns - start_ns) * 1e-9
        if not SWEEP_RANGE_S[0] <= sweep_s <= SWEEP_RANGE_S[1]:
            odd_sweeps += 1
            sweep_s = NOMINAL_SWEEP_S
        scans.append(Scan(file, start_ns, sweep_s, forward_ns))
    if not scans:
        raise UserError(f"{folder}: none of its scans has a time stamp: is the drive unpacked completely?")
    if lost:
        notes.append(f"{len(lost)} scans have no time stamp and are left out, the first is frame {lost[0]}")
    expected = files[-1][0] - files[0][0] + 1
    if expected != len(files):
        notes.append(
            f"{expected - len(files)} scans are missing between frames {files[0][0]} and {files[-1][0]}"
        )
    if frames is not None and (files[0][0] != frames[0] or files[-1][0] != frames[1]):
        notes.append(f"only frames {files[0][0]} .. {files[-1][0]} of {frames[0]} .. {frames[1]} exist")
    if odd_sweeps:
        notes.append(
            f"{odd_sweeps} sweeps had start and end stamps that are no 0.1 s apart: taken as "
            f"{NOMINAL_SWEEP_S} s"
        )
    return sorted(scans, key=lambda scan: scan.start_ns)


def _oxts_notes(oxts: kitti_raw.Oxts) -> List[str]:
    """What was repaired."""
    notes = []
    if oxts.unsorted:
        notes.append(f"{oxts.unsorted} oxts packets were out of order: sorted")
    if oxts.repeated:
        notes.append(f"{oxts.repeated} oxts packets repeated a stamp: dropped")
    return notes
