"""Rotations as unit quaternions (x, y, z, w) and 3x3 matrices, many at once.

Arrays of quaternions are N x 4, arrays of matrices N x 3 x 3. A quaternion of the pose of body b in frame a
turns vectors from b to a: v_a = R(q) v_b.
"""

import numpy as np


def normalised(quaternions: np.ndarray) -> np.ndarray:
    """Quaternions of length 1; the caller has made sure that none is zero."""
    return quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)


def to_matrices(quaternions: np.ndarray) -> np.ndarray:
    """Rotation matrices of N x 4 unit quaternions: R = I + 2 w [v]x + 2 [v]x^2."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    rows = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ]
    return np.stack(rows, axis=-1).reshape(quaternions.shape[:-1] + (3, 3))


def from_matrices(matrices: np.ndarray) -> np.ndarray:
    """Unit quaternions (w >= 0) of N x 3 x 3 rotation matrices.

    The squares of the four components follow from the diagonal; the largest is taken as the divisor,
    so that the result is accurate near half turns too.
    """
    m = np.asarray(matrices, dtype=float)
    trace = m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2]
    four_squares = np.stack(
        [2 * m[:, 0, 0] - trace, 2 * m[:, 1, 1] - trace, 2 * m[:, 2, 2] - trace, trace], axis=1
    ) + 1
    yz, zx, xy = m[:, 2, 1], m[:, 0, 2], m[:, 1, 0]
    zy, xz, yx = m[:, 1, 2], m[:, 2, 0], m[:, 0, 1]
    # products[n, i, j] = 4 q_i q_j in the order x, y, z, w
    products = np.empty((len(m), 4, 4))
    products[:, range(4), range(4)] = four_squares
    for (i, j), value in {
        (0, 1): xy + yx, (0, 2): zx + xz, (1, 2): yz + zy,
        (0, 3): yz - zy, (1, 3): zx - xz, (2, 3): xy - yx,
    }.items():
        products[:, i, j] = products[:, j, i] = value
    rows = products[np.arange(len(m)), np.argmax(four_squares, axis=1)]
    quaternions = normalised(rows)
    return np.where(quaternions[:, 3:4] < 0, -quaternions, quaternions)


def angles_deg(matrices: np.ndarray) -> np.ndarray:
    """Angle of each rotation in degrees, in [0, 180].

    Uses atan2(|vee(R - R')| / 2, (tr R - 1) / 2), which is accurate for small angles, where the arc cosine
    of the trace loses half of the digits.
    """
    sines = 0.5 * np.stack(
        [
            matrices[:, 2, 1] - matrices[:, 1, 2],
            matrices[:, 0, 2] - matrices[:, 2, 0],
            matrices[:, 1, 0] - matrices[:, 0, 1],
        ],
        axis=1,
    )
    cosines = 0.5 * (np.trace(matrices, axis1=1, axis2=2) - 1.0)
    return np.degrees(np.arctan2(np.linalg.norm(sines, axis=1), cosines))


def slerp(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Spherical interpolation, row by row: `share` 0 gives `first`, 1 gives `second`, the shorter way round.
    """
    dot = np.sum(first * second, axis=1)
    second = np.where(dot[:, None] < 0, -second, second)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sine = np.sin(angle)
    # Below 1e-6 rad the sine is too small to divide by, and linear interpolation is exact to 1e-13.
    small = sine < 1e-6
    safe = np.where(small, 1.0, sine)
    weight_first = np.where(small, 1.0 - share, np.sin((1.0 - share) * angle) / safe)
    weight_second = np.where(small, share, np.sin(share * angle) / safe)
    return normalised(weight_first[:, None] * first + weight_second[:, None] * second)


def from_roll_pitch_yaw(roll: np.ndarray, pitch: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Rotation matrices R = Rz(yaw) Ry(pitch) Rx(roll) (angles in rad), N x 3 x 3."""
    (cr, cp, cy), (sr, sp, sy) = (f([roll, pitch, yaw]) for f in (np.cos, np.sin))
    rows = [
        cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr,
        sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr,
        -sp, cp * sr, cp * cr,
    ]
    return np.stack(rows, axis=-1).reshape(-1, 3, 3)
