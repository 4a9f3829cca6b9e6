"""Errors of an estimate against paired ground truth. The formulas are explained in docs/evaluation.md."""

from dataclasses import dataclass
from typing import Dict, List, Sequence

import numpy as np

from . import rotations
from .trajectory import Trajectory

STATISTICS = ("rmse", "mean", "median", "std", "min", "max", "sse")
KITTI_LENGTHS_M = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
SHORT_LENGTHS_M = (10.0, 20.0, 50.0)
KITTI_STEP = 10  # every tenth pose starts a segment


def statistics(errors: np.ndarray) -> Dict[str, float]:
    """rmse, mean, median, std (population), min, max, and sse, the sum of squares."""
    squares = errors**2
    values = (
        np.sqrt(squares.mean()), errors.mean(), np.median(errors), errors.std(), errors.min(), errors.max(),
        squares.sum()
    )
    return dict(zip(STATISTICS, map(float, values)))


def position_errors_m(estimate: Trajectory, truth: Trajectory) -> np.ndarray:
    """|p_estimate - p_truth| of each pair, in metres (ATE, "APE w.r.t. translation part" of evo)."""
    return np.linalg.norm(estimate.positions - truth.positions, axis=1)


def rotation_errors_deg(estimate: Trajectory, truth: Trajectory) -> np.ndarray:
    """Angle of R_estimate' R_truth of each pair, in degrees."""
    relative = np.swapaxes(estimate.rotation_matrices, 1, 2) @ truth.rotation_matrices
    return rotations.angles_deg(relative)


@dataclass(frozen=True)
class RelativeErrors:
    """Errors of the motion from pose `first[i]` to pose `last[i]`: metres and degrees."""

    first: np.ndarray
    last: np.ndarray
    translation_m: np.ndarray
    rotation_deg: np.ndarray


def relative_errors(
    estimate: Trajectory, truth: Trajectory, first: np.ndarray, last: np.ndarray
) -> RelativeErrors:
    """E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j) with truth Q and estimate P; its translation and its angle."""
    rotation_q, step_q = _motions(truth, first, last)
    rotation_p, step_p = _motions(estimate, first, last)
    # t(E) = R_q' (step_p - step_q), whose length does not depend on R_q
    translation = np.linalg.norm(step_p - step_q, axis=1)
    angle = rotations.angles_deg(np.swapaxes(rotation_q, 1, 2) @ rotation_p)
    return RelativeErrors(first, last, translation, angle)


def _motions(trajectory: Trajectory, first: np.ndarray, last: np.ndarray) -> tuple:
    """Rotation and translation of T_first^-1 T_last."""
    matrices = trajectory.rotation_matrices
    inverse = np.swapaxes(matrices[first], 1, 2)
    step = trajectory.positions[last] - trajectory.positions[first]
    return inverse @ matrices[last], np.einsum("nij,nj->ni", inverse, step)


def consecutive_errors(estimate: Trajectory, truth: Trajectory, delta: int) -> RelativeErrors:
    """Relative errors from pose 0 to delta, delta to 2 delta, and so on (RPE, as evo without --all_pairs)."""
    ends = np.arange(0, len(estimate), delta)
    return relative_errors(estimate, truth, ends[:-1], ends[1:])


@dataclass(frozen=True)
class SegmentErrors:
    """Mean relative errors over path segments of the truth; `length_m` 0 stands for the mean over all
    lengths.
    """

    length_m: float
    segments: int
    translation_percent: float
    rotation_deg_per_100m: float


def segment_errors(
    estimate: Trajectory, truth: Trajectory, lengths_m: Sequence[float]
) -> List[SegmentErrors]:
    """The KITTI odometry metric: a row for each length that fits, and last the mean over all segments.

    A segment starts at every tenth pose and ends at the first pose whose path length along the truth is more
    than `length` further on. Errors are divided by `length`. Empty if no segment fits.
    """
    distances = truth.distances_m()
    starts = np.arange(0, len(truth), KITTI_STEP)
    rows: List[SegmentErrors] = []
    all_translation: List[np.ndarray] = []
    all_rotation: List[np.ndarray] = []
    for length in lengths_m:
        ends = np.searchsorted(distances, distances[starts] + length, side="right")
        fits = ends < len(truth)
        if not fits.any():
            continue
        errors = relative_errors(estimate, truth, starts[fits], ends[fits])
        all_translation.append(100.0 * errors.translation_m / length)
        all_rotation.append(100.0 * errors.rotation_deg / length)
        rows.append(_segment_row(length, all_translation[-1], all_rotation[-1]))
    if rows:
        rows.append(_segment_row(0.0, np.concatenate(all_translation), np.concatenate(all_rotation)))
    return rows


def _segment_row(length_m: float, translation_percent: np.ndarray, rotation: np.ndarray) -> SegmentErrors:
    return SegmentErrors(length_m, len(rotation), float(translation_percent.mean()), float(rotation.mean()))


def covered_share(pair_stamps: np.ndarray, truth: Trajectory, max_gap_s: float) -> float:
    """Share of the truth's duration that lies between paired poses at most `max_gap_s` apart, in [0, 1]."""
    gaps = np.diff(pair_stamps)
    return float(gaps[gaps <= max_gap_s].sum() / truth.duration_s) if truth.duration_s > 0 else 0.0
