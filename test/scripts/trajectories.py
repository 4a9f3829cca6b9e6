"""Trajectories whose errors are known in closed form."""

from pathlib import Path

import numpy as np

from fdi_lio_scripts import rotations
from fdi_lio_scripts.trajectory import Trajectory


def helix(count: int = 200, rate_hz: float = 10.0, start_s: float = 100.0) -> Trajectory:
    """A helix of radius 10 m with the body turned along it: not on a line or plane, so alignments are unique.
    """
    angle = np.arange(count) * 0.05
    positions = np.column_stack([10 * np.cos(angle), 10 * np.sin(angle), 0.3 * angle])
    quaternions = np.column_stack([0 * angle, 0 * angle, np.sin(angle / 2), np.cos(angle / 2)])
    return Trajectory("helix", start_s + np.arange(count) / rate_hz, positions, quaternions)


def line(length_m: float, step_m: float, scale: float = 1.0, yaw_per_m: float = 0.0) -> Trajectory:
    """A straight path along x; the body's yaw drifts by `yaw_per_m` rad a metre while the path stays
    straight.
    """
    x = np.arange(0, length_m + 0.5 * step_m, step_m)
    yaw = yaw_per_m * x
    positions = np.column_stack([scale * x, 0 * x, 0 * x])
    return Trajectory("line", 0.1 * np.arange(len(x)), positions,
                      np.column_stack([0 * x, 0 * x, np.sin(yaw / 2), np.cos(yaw / 2)]))


def moved(
    trajectory: Trajectory, scale: float, axis: np.ndarray, angle: float, shift: np.ndarray
) -> Trajectory:
    """The trajectory in another frame: p' = scale * R p + shift, R' = R R_body."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    quaternion = np.concatenate([np.sin(angle / 2) * axis, [np.cos(angle / 2)]])
    rotation = rotations.to_matrices(quaternion[None])[0]
    turned = rotations.from_matrices(rotation @ trajectory.rotation_matrices)
    return Trajectory(
        trajectory.name, trajectory.stamps, scale * trajectory.positions @ rotation.T + shift, turned
    )


def write_tum(path: Path, trajectory: Trajectory) -> Path:
    """Writes a TUM file with all digits."""
    rows = np.column_stack([trajectory.stamps, trajectory.positions, trajectory.quaternions])
    np.savetxt(path, rows, fmt="%.17g", header="stamp tx ty tz qx qy qz qw")
    return path
