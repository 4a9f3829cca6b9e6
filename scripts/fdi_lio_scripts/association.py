"""Pairs the poses of two trajectories by time."""

from dataclasses import dataclass
from typing import Tuple

import numpy as np

from . import rotations
from .errors import UserError
from .trajectory import Trajectory

MIN_PAIRS = 3  # fewer do not determine a rotation


@dataclass(frozen=True)
class Pairs:
    """Estimate and ground truth, pose by pose, and how often a pose had to serve twice."""

    estimate: Trajectory
    truth: Trajectory
    reused: int


def associate(
    estimate: Trajectory, truth: Trajectory, max_diff_s: float, interpolate: bool, once: bool
) -> Pairs:
    """Pairs by the nearest stamp, or with the truth interpolated at the estimate's stamps."""
    _check_overlap(estimate, truth)
    if interpolate:
        pairs = _interpolated(estimate, truth)
    else:
        pairs = _nearest(estimate, truth, max_diff_s, once)
    if len(pairs.estimate) < MIN_PAIRS:
        hint = "" if interpolate else f" within {max_diff_s} s: try --interpolate, or a larger --max-diff"
        raise UserError(
            f"{estimate.name} and {truth.name}: only {len(pairs.estimate)} poses match{hint}; "
            f"at least {MIN_PAIRS} are needed"
        )
    return pairs


def _nearest(estimate: Trajectory, truth: Trajectory, max_diff_s: float, once: bool) -> Pairs:
    """For each pose of the trajectory with fewer poses the nearest of the other (the rule of evo)."""
    # With equal lengths evo looks up from its second argument, the estimate.
    truth_is_longer = len(truth) >= len(estimate)
    short, long = (estimate, truth) if truth_is_longer else (truth, estimate)
    nearest = nearest_indices(short.stamps, long.stamps)
    differences = np.abs(long.stamps[nearest] - short.stamps)
    kept = np.flatnonzero(differences <= max_diff_s)
    reused = len(kept) - len(np.unique(nearest[kept]))
    if once and reused:
        kept = _closest_use(kept, nearest, differences)
    short_poses, long_poses = short.take(kept), long.take(nearest[kept])
    if truth_is_longer:
        return Pairs(short_poses, long_poses, 0 if once else reused)
    return Pairs(long_poses, short_poses, 0 if once else reused)


def nearest_indices(stamps: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Index of the element of the sorted array `among` nearest to each stamp; the earlier one on a tie."""
    right = np.clip(np.searchsorted(among, stamps), 1, max(len(among) - 1, 1))
    left = right - 1
    right = np.minimum(right, len(among) - 1)
    return np.where(np.abs(among[left] - stamps) <= np.abs(among[right] - stamps), left, right)


def _closest_use(kept: np.ndarray, nearest: np.ndarray, differences: np.ndarray) -> np.ndarray:
    """Of several poses that chose the same partner, keeps the one closest in time."""
    by_difference = kept[np.argsort(differences[kept], kind="stable")]
    _, first_uses = np.unique(nearest[by_difference], return_index=True)
    return np.sort(by_difference[first_uses])


def _interpolated(estimate: Trajectory, truth: Trajectory) -> Pairs:
    """The truth at each stamp of the estimate inside its time span: positions linear, rotations by slerp."""
    inside = np.flatnonzero((estimate.stamps >= truth.stamps[0]) & (estimate.stamps <= truth.stamps[-1]))
    if len(truth) < 2:
        inside = inside[:0]
    chosen = estimate.take(inside)
    if len(inside) == 0:
        return Pairs(chosen, truth.take(np.arange(0)), 0)
    return Pairs(chosen, interpolate_at(truth, chosen.stamps), 0)


def interpolate_at(trajectory: Trajectory, stamps: np.ndarray) -> Trajectory:
    """Poses of `trajectory` (two poses or more) at `stamps` inside its time span."""
    right = np.clip(np.searchsorted(trajectory.stamps, stamps), 1, len(trajectory) - 1)
    left = right - 1
    share = (stamps - trajectory.stamps[left]) / (trajectory.stamps[right] - trajectory.stamps[left])
    step = trajectory.positions[right] - trajectory.positions[left]
    return Trajectory(
        trajectory.name,
        stamps,
        trajectory.positions[left] + share[:, None] * step,
        rotations.slerp(trajectory.quaternions[left], trajectory.quaternions[right], share),
    )


def time_base(stamp: float) -> Tuple[str, str]:
    """What a stamp looks like, and the unit that --est-unit or --gt-unit would name."""
    for limit, text, unit in (
        (1e17, "nanoseconds since 1970", "ns"),
        (1e14, "microseconds since 1970", "us"),
        (1e11, "milliseconds since 1970", "ms"),
        (1e8, "seconds since 1970", "s"),
    ):
        if abs(stamp) >= limit:
            return text, unit
    return "seconds from the start of a recording", "s"


def _check_overlap(estimate: Trajectory, truth: Trajectory) -> None:
    """Refuses trajectories that share no time, and says so when their time bases differ."""
    if estimate.stamps[0] <= truth.stamps[-1] and truth.stamps[0] <= estimate.stamps[-1]:
        return
    spans = " and ".join(f"{t.name} spans {t.stamps[0]:.3f} .. {t.stamps[-1]:.3f}" for t in (estimate, truth))
    bases = [time_base(t.stamps[0]) for t in (estimate, truth)]
    if bases[0] == bases[1]:
        raise UserError(
            f"the trajectories share no time: {spans}: are they of the same recording? (see --time-offset)"
        )
    raise UserError(
        f"mixed time bases: {spans}: the first looks like {bases[0][0]}, the second like {bases[1][0]}: "
        f"give --est-unit {bases[0][1]} --gt-unit {bases[1][1]}, --kitti-times, or --time-offset"
    )
