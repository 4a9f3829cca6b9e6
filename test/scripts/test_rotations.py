"""Quaternions and matrices against closed forms."""

import numpy as np

from fdi_lio_scripts import rotations


def test_matrix_of_a_quarter_turn_about_z():
    matrix = rotations.to_matrices(np.array([[0, 0, np.sqrt(0.5), np.sqrt(0.5)]]))[0]
    np.testing.assert_allclose(matrix, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


def test_quaternions_survive_the_way_through_matrices_also_near_half_turns():
    random = np.random.default_rng(1)
    quaternions = rotations.normalised(random.normal(size=(500, 4)))
    quaternions[:4] = np.eye(4)  # half turns about x, y, z and the identity
    quaternions[4] = rotations.normalised(np.array([1, 1e-9, 0, 1e-9]))
    quaternions[quaternions[:, 3] < 0] *= -1
    back = rotations.from_matrices(rotations.to_matrices(quaternions))
    np.testing.assert_allclose(np.abs(np.sum(back * quaternions, axis=1)), 1.0, atol=1e-14)
    np.testing.assert_allclose(rotations.to_matrices(back), rotations.to_matrices(quaternions), atol=1e-14)


def test_small_angles_keep_their_digits():
    for degrees in (0.0, 1e-6, 1e-3, 1.0, 90.0, 179.999, 180.0):
        half = np.radians(degrees) / 2
        matrix = rotations.to_matrices(np.array([[np.sin(half), 0, 0, np.cos(half)]]))
        np.testing.assert_allclose(rotations.angles_deg(matrix), [degrees], rtol=1e-9, atol=1e-12)


def test_slerp_turns_at_constant_speed_and_the_short_way():
    first = np.array([[0, 0, 0, 1.0]] * 3)
    half = np.radians(80) / 2
    second = -np.array([[0, 0, np.sin(half), np.cos(half)]] * 3)  # the same rotation with the other sign
    between = rotations.slerp(first, second, np.array([0.0, 0.25, 1.0]))
    np.testing.assert_allclose(rotations.angles_deg(rotations.to_matrices(between)), [0, 20, 80], atol=1e-9)


def test_roll_pitch_yaw_is_rz_ry_rx():
    roll, pitch, yaw = (np.array([a]) for a in (0.1, -0.2, 2.5))
    zero = np.zeros(1)
    expected = (
        rotations.from_roll_pitch_yaw(zero, zero, yaw)[0]
        @ rotations.from_roll_pitch_yaw(zero, pitch, zero)[0]
        @ rotations.from_roll_pitch_yaw(roll, zero, zero)[0]
    )
    np.testing.assert_allclose(rotations.from_roll_pitch_yaw(roll, pitch, yaw)[0], expected, atol=1e-15)
    # positive pitch about y turns the nose (x) down
    np.testing.assert_allclose(
        rotations.from_roll_pitch_yaw(zero, np.array([np.pi / 2]), zero)[0] @ [1, 0, 0],
        [0, 0, -1],
        atol=1e-15,
    )
