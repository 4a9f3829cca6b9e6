"""A trajectory: the pose of one body in one fixed frame at increasing stamps."""

from dataclasses import dataclass

import numpy as np

from . import rotations
from .errors import UserError


@dataclass(frozen=True)
class Trajectory:
    """Poses T_world_body at stamps.

    name: what messages and tables call it (mostly the file name).
    stamps: N seconds, strictly increasing.
    positions: N x 3 metres in the world frame.
    quaternions: N x 4 unit quaternions x y z w of R_world_body.
    """

    name: str
    stamps: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray

    def __len__(self) -> int:
        return len(self.stamps)

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last stamp."""
        return float(self.stamps[-1] - self.stamps[0])

    @property
    def rotation_matrices(self) -> np.ndarray:
        """N x 3 x 3 matrices R_world_body."""
        return rotations.to_matrices(self.quaternions)

    def take(self, indices: np.ndarray) -> "Trajectory":
        """The poses at `indices`, in that order."""
        return Trajectory(self.name, self.stamps[indices], self.positions[indices], self.quaternions[indices])

    def distances_m(self) -> np.ndarray:
        """Path length from the first pose to each pose, in metres: d_i = sum_{k<=i} |p_k - p_{k-1}|."""
        steps = np.linalg.norm(np.diff(self.positions, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])


def checked(name: str, rows: np.ndarray, places: np.ndarray, sort: bool = False) -> Trajectory:
    """Makes a trajectory of rows `stamp x y z qx qy qz qw`, or explains which row is bad.

    `places` holds the line or message number of each row, for the messages. `sort` puts rows in order of time
    and keeps the first of those with equal stamps; without it both are errors.
    """
    if len(rows) == 0:
        raise UserError(f"{name}: holds no poses: check that the recording or the run wrote any")
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(bad):
        raise UserError(
            f"{name}: {len(bad)} poses are NaN or infinite, the first at line {places[bad[0]]}: "
            "remove these lines, or find out why the estimate failed there"
        )
    lengths = np.linalg.norm(rows[:, 4:8], axis=1)
    bad = np.flatnonzero(np.abs(lengths - 1.0) > 0.01)
    if len(bad):
        raise UserError(
            f"{name}: the quaternion at line {places[bad[0]]} has length {lengths[bad[0]]:.3g} instead of 1: "
            "the columns must be stamp tx ty tz qx qy qz qw"
        )
    if sort:
        _, first_uses = np.unique(rows[:, 0], return_index=True)
        rows, places = rows[first_uses], places[first_uses]
    steps = np.diff(rows[:, 0])
    bad = np.flatnonzero(steps <= 0)
    if len(bad):
        kind = "repeats" if steps[bad[0]] == 0 else "goes back"
        raise UserError(
            f"{name}: the stamp {kind} at line {places[bad[0] + 1]} ({rows[bad[0], 0]:.9f} then "
            f"{rows[bad[0] + 1, 0]:.9f}), {len(bad)} times in all: sort the file, or give --sort"
        )
    return Trajectory(name, rows[:, 0], rows[:, 1:4], rotations.normalised(rows[:, 4:8]))
