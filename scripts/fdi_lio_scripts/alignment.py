"""Moves an estimate onto the ground truth: least squares over positions, or by the first pose."""

from dataclasses import dataclass

import numpy as np

from . import rotations
from .trajectory import Trajectory

MODES = ("se3", "sim3", "yaw", "first", "none")


@dataclass(frozen=True)
class Alignment:
    """p_truth = scale * R p_estimate + t, R_truth = R R_estimate."""

    scale: float
    rotation: np.ndarray
    translation: np.ndarray

    def apply(self, trajectory: Trajectory) -> Trajectory:
        """The trajectory in the frame of the truth."""
        positions = self.scale * trajectory.positions @ self.rotation.T + self.translation
        turned = self.rotation @ trajectory.rotation_matrices
        return Trajectory(trajectory.name, trajectory.stamps, positions, rotations.from_matrices(turned))


def align(estimate: Trajectory, truth: Trajectory, mode: str) -> Alignment:
    """The alignment of paired trajectories in one of `MODES`."""
    if mode == "se3":
        return umeyama(estimate.positions, truth.positions, with_scale=False)
    if mode == "sim3":
        return umeyama(estimate.positions, truth.positions, with_scale=True)
    if mode == "yaw":
        return yaw_only(estimate.positions, truth.positions)
    if mode == "first":
        rotation = truth.rotation_matrices[0] @ estimate.rotation_matrices[0].T
        return Alignment(1.0, rotation, truth.positions[0] - rotation @ estimate.positions[0])
    return Alignment(1.0, np.eye(3), np.zeros(3))


def umeyama(source: np.ndarray, target: np.ndarray, with_scale: bool) -> Alignment:
    """Minimises sum |target_i - (c R source_i + t)|^2 over R, t and, if asked, the scale c.

    S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns", PAMI 1991:
    equation numbers are of that paper. Points are N x 3.
    """
    mean_source, mean_target = source.mean(axis=0), target.mean(axis=0)  # (34), (35)
    centred = source - mean_source
    variance = float(np.mean(np.sum(centred**2, axis=1)))  # (36)
    covariance = (target - mean_target).T @ centred / len(source)  # (38)
    u, singular_values, v_transposed = np.linalg.svd(covariance)
    signs = np.ones(3)
    if np.linalg.det(u) * np.linalg.det(v_transposed) < 0:  # (39), (43): a rotation, never a reflection
        signs[2] = -1.0
    rotation = (u * signs) @ v_transposed  # (40)
    scale = 1.0
    if with_scale and variance > 0:
        scale = float(singular_values @ signs) / variance  # (42)
    return Alignment(scale, rotation, mean_target - scale * rotation @ mean_source)  # (41)


def yaw_only(source: np.ndarray, target: np.ndarray) -> Alignment:
    """Rotation about z and translation only, for estimates whose roll and pitch come from gravity.

    The sum of squares is largest in psi = atan2(sum (x y' - y x'), sum (x x' + y y')) of the centred points.
    """
    mean_source, mean_target = source.mean(axis=0), target.mean(axis=0)
    a, b = source - mean_source, target - mean_target
    yaw = np.arctan2(
        np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1])
    )
    rotation = rotations.from_roll_pitch_yaw(np.zeros(1), np.zeros(1), np.array([yaw]))[0]
    return Alignment(1.0, rotation, mean_target - rotation @ mean_source)
