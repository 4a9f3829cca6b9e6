"""Is the covariance that the estimator states the size of the error that it makes? Normalised estimation error
squared (NEES) of the pose.

The estimate starts at the truth's first pose. The error of a later pose is, in the tangent of covariance.csv,
    e = [log(R_est^T R_true), t_true - t_est]   (rotation in body axes, translation in odom axes),
and NEES = e^T P^-1 e, which is chi-square distributed when P is right: with 6 degrees of freedom for the pose,
with 3 for the position or the rotation alone.
"""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, Tuple

import numpy as np

from . import rotations
from .alignment import align
from .association import associate
from .errors import UserError
from .trajectory import Trajectory

# Two-sided 95 % bounds of the chi-square distribution by degrees of freedom.
BOUNDS_95 = {3: (0.2158, 9.3484), 6: (1.2373, 14.4494)}


@dataclass(frozen=True)
class Consistency:
    """NEES of each pose, by what it is of: `pose`, `position`, `rotation`; error and stated deviation."""

    stamps: np.ndarray
    nees: Dict[str, np.ndarray]
    position_errors_m: np.ndarray
    position_sigma_m: np.ndarray

    def shares(self, of: str) -> Tuple[float, float, float]:
        """Shares of poses below, within and above the 95 % bounds: too cautious, right, too certain."""
        low, high = BOUNDS_95[6 if of == "pose" else 3]
        values = self.nees[of]
        below, above = float(np.mean(values < low)), float(np.mean(values > high))
        return below, 1.0 - below - above, above


def read_covariances(path: str) -> Tuple[np.ndarray, np.ndarray]:
    """Stamps and N x 6 x 6 covariances [rotation, translation] of a covariance.csv."""
    if not Path(path).is_file():
        raise UserError(f"{path}: no such file: give the folder of a run")
    with open(path, encoding="utf-8", newline="") as stream:
        rows = [row for row in csv.reader(stream) if row][1:]
    if not rows or any(len(row) != 22 for row in rows):
        raise UserError(f"{path}: is no covariance.csv with a stamp and 21 numbers a line")
    numbers = np.array(rows, dtype=float)
    matrices = np.zeros((len(rows), 6, 6))
    upper = np.triu_indices(6)
    matrices[:, upper[0], upper[1]] = numbers[:, 1:]
    matrices[:, upper[1], upper[0]] = numbers[:, 1:]
    return numbers[:, 0], matrices


def evaluate_consistency(
    estimate: Trajectory, truth: Trajectory, stamps: np.ndarray, covariances: np.ndarray
) -> Consistency:
    """NEES of every pose of `estimate` after the first that has a covariance and a truth."""
    pairs = associate(estimate, truth, max_diff_s=0.01, interpolate=True, once=False)
    moved = align(pairs.truth, pairs.estimate, "first").apply(pairs.truth)  # truth in the frame of odom
    index = np.searchsorted(stamps, pairs.estimate.stamps - 1e-6)
    known = (index < len(stamps)) & (np.arange(len(pairs.estimate)) > 0)
    known[known] = np.abs(stamps[index[known]] - pairs.estimate.stamps[known]) < 1e-6
    chosen = np.flatnonzero(known)
    if len(chosen) == 0:
        raise UserError("no pose of the trajectory has a covariance: do both files come from one run?")
    R_est = pairs.estimate.rotation_matrices[chosen]
    turn = np.einsum("nji,njk->nik", R_est, moved.rotation_matrices[chosen])
    errors = np.hstack(
        [rotation_vectors(turn), moved.positions[chosen] - pairs.estimate.positions[chosen]]
    )
    P = covariances[index[chosen]]

    def nees(part: slice) -> np.ndarray:
        solved = np.linalg.solve(P[:, part, part], errors[:, part, None])[:, :, 0]
        return np.einsum("ni,ni->n", errors[:, part], solved)

    return Consistency(
        stamps=pairs.estimate.stamps[chosen],
        nees={"pose": nees(slice(0, 6)), "rotation": nees(slice(0, 3)), "position": nees(slice(3, 6))},
        position_errors_m=np.linalg.norm(errors[:, 3:], axis=1),
        position_sigma_m=np.sqrt(np.trace(P[:, 3:, 3:], axis1=1, axis2=2)),
    )


def rotation_vectors(matrices: np.ndarray) -> np.ndarray:
    """Logarithms of N rotation matrices."""
    quaternions = rotations.from_matrices(matrices)
    signs = np.where(quaternions[:, 3:] < 0.0, -1.0, 1.0)
    vectors, scalars = quaternions[:, :3] * signs, quaternions[:, 3] * signs[:, 0]
    norms = np.linalg.norm(vectors, axis=1)
    angles = 2.0 * np.arctan2(norms, scalars)
    return vectors * np.where(norms > 1e-12, angles / np.maximum(norms, 1e-12), 2.0)[:, None]
