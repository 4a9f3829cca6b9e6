"""Were the loops that a run accepted right, and which revisits did it miss? Compares loops.csv with the truth.

A loop states T_from_to and its covariance P in the tangent [dtheta (axes of `to`), dt (axes of `from`)]. With
    e = [log(R_stated^T R_true), t_true - t_stated],    Q = P + diag(0.5 deg, 0.1 m)^2
it is wrong when e^T Q^-1 e > 22.46, what a right one exceeds once in a thousand times (chi-square, 6 degrees of
freedom): what a loop says that it does not know, it cannot get wrong.

A revisit is a place, one every `spacing_m` of the true way, that is within `radius_m` of the way at least
`min_path_m` before. It was found when a loop was accepted within `spacing_m` of way about it.
"""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import List

import numpy as np

from . import rotations
from .association import interpolate_at
from .consistency import rotation_vectors
from .errors import UserError
from .trajectory import Trajectory

WRONG_CHI_SQUARE = 22.46
BASE_SIGMA = np.array([np.radians(0.5)] * 3 + [0.1] * 3)


@dataclass(frozen=True)
class Loop:
    """One candidate of loops.csv."""

    stamp_from: float
    stamp_to: float
    verdict: str
    position: np.ndarray
    quaternion: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True)
class LoopEvaluation:
    """What became of the candidates, and of the revisits that the truth has."""

    candidates: int
    accepted: int
    chi_squares: np.ndarray  # of the accepted
    position_errors_m: np.ndarray  # of the accepted, unknown directions included
    revisits: int
    found: int

    @property
    def wrong(self) -> int:
        """Accepted loops that contradict the truth."""
        return int(np.sum(self.chi_squares > WRONG_CHI_SQUARE))


def read_loops(path: str) -> List[Loop]:
    """The candidates of a loops.csv."""
    if not Path(path).is_file():
        raise UserError(f"{path}: no such file: give the folder of a run")
    with open(path, encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    upper = np.triu_indices(6)
    loops = []
    for row in rows:
        try:
            covariance = np.zeros((6, 6))
            covariance[upper] = [float(row[f"c{a}{b}"]) for a, b in zip(*upper)]
            covariance = covariance + np.triu(covariance, 1).T
            position = np.array([float(row[name]) for name in ("tx", "ty", "tz")])
            quaternion = np.array([float(row[name]) for name in ("qx", "qy", "qz", "qw")])
            stamps = float(row["stamp_from"]), float(row["stamp_to"])
        except (KeyError, TypeError, ValueError) as error:
            raise UserError(f"{path}: is no loops.csv of offline_slam ({error})") from error
        loops.append(Loop(*stamps, row["verdict"], position, quaternion, covariance))
    return loops


def evaluate_loops(
    loops: List[Loop], truth: Trajectory, min_path_m: float, radius_m: float = 5.0, spacing_m: float = 5.0
) -> LoopEvaluation:
    """Compares the accepted loops and the revisits with the truth."""
    accepted = [loop for loop in loops if loop.verdict == "accepted"]
    chi_squares, errors = _loop_errors(accepted, truth)
    ways = truth.distances_m()
    places_m = np.arange(0.0, ways[-1], spacing_m)
    places = np.stack([np.interp(places_m, ways, truth.positions[:, k]) for k in range(3)], axis=1)
    revisits_m = [
        way for way, place in zip(places_m, places)
        if np.any(np.linalg.norm(places[places_m <= way - min_path_m] - place, axis=1) <= radius_m)
    ]
    closed_m = np.array([np.interp(loop.stamp_to, truth.stamps, ways) for loop in accepted])
    found = [way for way in revisits_m if len(closed_m) and np.min(np.abs(closed_m - way)) <= spacing_m]
    return LoopEvaluation(len(loops), len(accepted), chi_squares, errors, len(revisits_m), len(found))


def _loop_errors(loops, truth):
    """Normalised squared error and distance to the truth of each loop."""
    if not loops:
        return np.zeros(0), np.zeros(0)
    begin = interpolate_at(truth, np.array([loop.stamp_from for loop in loops]))
    end = interpolate_at(truth, np.array([loop.stamp_to for loop in loops]))
    from_world = begin.rotation_matrices.transpose(0, 2, 1)
    t_true = np.einsum("nij,nj->ni", from_world, end.positions - begin.positions)
    stated = rotations.to_matrices(np.array([loop.quaternion for loop in loops]))
    turns = rotation_vectors(stated.transpose(0, 2, 1) @ from_world @ end.rotation_matrices)
    shifts = t_true - np.array([loop.position for loop in loops])
    e = np.concatenate([turns, shifts], axis=1)
    Q = np.array([loop.covariance for loop in loops]) + np.diag(BASE_SIGMA ** 2)
    return np.einsum("ni,ni->n", e, np.linalg.solve(Q, e[:, :, None])[:, :, 0]), np.linalg.norm(shifts, axis=1)
