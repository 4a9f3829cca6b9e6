"""What the degeneracy of a simulated scan should have been: errors and class of the surroundings.

Registration error of scan k: what is left of a start beside the true pose when the scan is registered with the scans
before it at their true poses (evaluate_registration writes it to STEM.registration.csv).

Drift at scan k: translation of the relative pose error of the odometry P (before loop closures) over one second,
    d_k = |t((Q_i^-1 Q_j)^-1 (P_i^-1 P_j))|,   i the last scan at least 0.5 s before k, j the first 0.5 s after,
with truth Q. One second, because from scan to scan the noise of two poses hides the drift. Scans at the ends, where
i or j is missing, have none.

True class: from how the place was built and what moved in it, not from what the system made of it.
    poor     by construction the surfaces do not fix every direction well: tunnel, corridor and highway repeat along
             the way; a forest has hardly a flat surface; a mine is smooth when its relief is below ROUGH_RELIEF
             (rough rock fixes every direction); street_tunnel beyond `tunnel_begin_x`
    moving   at least MOVING_SHARE of the points of the scan lie on moving objects (FILE.labels), averaged over the
             last SMOOTHING_S seconds
    structured = neither, sparse = poor, dynamic = moving, mixed = both
"""

import re
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Optional

import numpy as np

from .association import interpolate_at
from .errors import UserError
from .metrics import relative_errors
from .trajectory import Trajectory

CLASSES = ("structured", "sparse", "dynamic", "mixed")
POOR_WORLDS = ("tunnel", "corridor", "highway", "forest")
ROUGH_RELIEF = 0.5
HALF_WINDOW_S = 0.5
MOVING_SHARE = 0.07
LARGEST_CLOCK_ERROR_S = 0.04  # less than half a scan
SMOOTHING_S = 1.0


def drifts_m(odometry: Trajectory, truth: Trajectory) -> np.ndarray:
    """d_k of each pose of `odometry`; NaN where the second about it is not covered."""
    stamps = odometry.stamps
    errors = np.full(len(stamps), np.nan)
    slack_s = 1e-6
    first = np.searchsorted(stamps, stamps - HALF_WINDOW_S + slack_s) - 1
    last = np.searchsorted(stamps, stamps + HALF_WINDOW_S - slack_s)
    covered = np.flatnonzero((first >= 0) & (last < len(stamps)))
    i, j = first[covered], last[covered]
    # A gap of the odometry would make the step longer than that of the others.
    near = stamps[j] - stamps[i] < 3 * HALF_WINDOW_S
    near &= (stamps[i] >= truth.stamps[0]) & (stamps[j] <= truth.stamps[-1])
    covered, i, j = covered[near], i[near], j[near]
    if len(covered) == 0:
        return errors
    inside = np.clip(stamps, truth.stamps[0], truth.stamps[-1])
    errors[covered] = relative_errors(odometry, interpolate_at(truth, inside), i, j).translation_m
    return errors


@dataclass(frozen=True)
class RegistrationErrors:
    """Of N scans; NaN for those that evaluate_registration left out."""

    error_m: np.ndarray
    geometric_m: np.ndarray  # without intensity features
    axis: np.ndarray  # N x 3, IMU frame, along which `geometric_m` lies


def no_registration_errors(count: int) -> RegistrationErrors:
    """Of so many scans that nobody measured."""
    return RegistrationErrors(np.full(count, np.nan), np.full(count, np.nan), np.full((count, 3), np.nan))


def read_registration_errors(path: Path, stamps: np.ndarray) -> RegistrationErrors:
    """Of the scans with these stamps [s].

    The stamps of the file are of the true clock of the lidar, so that they differ by the error of the clock.
    """
    errors = no_registration_errors(len(stamps))
    try:
        rows = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    except ValueError as error:
        raise UserError(f"{path}: is no file of evaluate_registration ({error}): write it again") from None
    if len(rows) == 0:
        return errors
    if rows.shape[1] != 6:
        raise UserError(
            f"{path}: has {rows.shape[1]} columns instead of stamp,error,geometric_error,x,y,z: write it again"
        )
    nearest = np.abs(stamps[:, None] - rows[:, 0]).argmin(axis=0)
    apart_s = np.abs(stamps[nearest] - rows[:, 0])
    if apart_s.max() > LARGEST_CLOCK_ERROR_S:
        raise UserError(f"{path}: has scans that the run has not: are both of the same recording?")
    errors.error_m[nearest] = rows[:, 1]
    errors.geometric_m[nearest] = rows[:, 2]
    errors.axis[nearest] = rows[:, 3:]
    return errors


@dataclass(frozen=True)
class Recording:
    """What simulate_bag wrote about a recording. `tunnel_begin_x_m` is infinite where there is none."""

    world: str
    relief: float
    tunnel_begin_x_m: float
    moving_points: Dict[int, int]  # by the header stamp of the scan [ns]

    def is_poor(self, x_m: np.ndarray) -> np.ndarray:
        """Whether the surroundings of positions with these x in the map leave directions weak."""
        smooth_mine = self.world == "mine" and self.relief < ROUGH_RELIEF
        return (x_m > self.tunnel_begin_x_m) | (self.world in POOR_WORLDS) | smooth_mine


def read_recording(stem: Path) -> Optional[Recording]:
    """STEM.yaml and STEM.labels; None when there is neither (a real recording)."""
    description, labels = Path(f"{stem}.yaml"), Path(f"{stem}.labels")
    if not description.is_file() and not labels.is_file():
        return None
    if not description.is_file() or not labels.is_file():
        raise UserError(f"{stem}: has only one of .yaml and .labels: keep both of them")
    text = description.read_text(encoding="utf-8")
    world = re.search(r"^  world:\n    type: ([a-z_]+)(?:\n    .*)*?\n    relief: (\S+)", text, re.MULTILINE)
    if not world:
        raise UserError(f"{description}: names no world type and relief: was it written by simulate_bag?")
    begin = re.search(r"^tunnel_begin_x: (\S+)", text, re.MULTILINE)
    if world[1] == "street_tunnel" and not begin:
        raise UserError(f"{description}: has no tunnel_begin_x: simulate the recording anew")
    return Recording(
        world[1], float(world[2]), float(begin[1]) if begin else np.inf, read_labels(labels)
    )


def read_labels(path: Path) -> Dict[int, int]:
    """Number of points on moving objects, by the header stamp of the scan [ns]."""
    content = path.read_bytes()
    counts: Dict[int, int] = {}
    position = 0
    while position < len(content):
        if position + 12 > len(content):
            raise UserError(f"{path}: is cut short")
        stamp, size = struct.unpack_from("<qI", content, position)
        position += 12
        if position + 2 * size > len(content):
            raise UserError(f"{path}: is cut short")
        labels = np.frombuffer(content, "<i2", size, position)
        counts[stamp] = int(np.count_nonzero(labels > 0))
        position += 2 * size
    return counts


def moving_shares(recording: Recording, stamps: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Share of moving points in each scan; `stamps` are reference stamps [s], up to a scan after the header's."""
    headers = np.array(sorted(recording.moving_points), dtype=np.int64)
    if len(headers) == 0:
        raise UserError("the labels hold no scan")
    index = np.clip(np.searchsorted(headers / 1e9, stamps - 1e-3) - 1, 0, len(headers) - 1)
    moving = np.array([recording.moving_points[h] for h in headers[index].tolist()], dtype=float)
    return np.minimum(1.0, moving / np.maximum(points, 1.0))


def true_classes(recording: Recording, truth: Trajectory, stamps: np.ndarray, points: np.ndarray) -> List[str]:
    """Class of the surroundings of each scan (see above); `points` is how many each has."""
    shares = moving_shares(recording, stamps, points)
    inside = np.clip(stamps, truth.stamps[0], truth.stamps[-1])
    x_m = interpolate_at(truth, inside).positions[:, 0]
    poor = recording.is_poor(x_m)
    moving = np.array([
        shares[(stamps > stamp - SMOOTHING_S) & (stamps <= stamp)].mean() >= MOVING_SHARE for stamp in stamps
    ])
    return [CLASSES[int(p) + 2 * int(m)] for p, m in zip(poor, moving)]
