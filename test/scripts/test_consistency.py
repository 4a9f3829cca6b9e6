"""NEES of a run against closed forms."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from fdi_lio_scripts.consistency import evaluate_consistency, read_covariances, rotation_vectors
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.trajectory import Trajectory

SCRIPT = Path(__file__).parents[2] / "scripts" / "evaluate_consistency.py"


def straight(count: int) -> Trajectory:
    """Along x at 1 m a second, without a turn."""
    stamps = np.arange(count, dtype=float)
    positions = np.stack([stamps, np.zeros(count), np.zeros(count)], axis=1)
    return Trajectory("straight", stamps, positions, np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))


def test_nees_of_a_known_error():
    truth = straight(5)
    shift = np.array([[0.0, 0.0, 0.0]] + [[0.1, -0.2, 0.3]] * 4)
    angle = 0.02
    turned = np.tile([0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)], (5, 1))
    turned[0] = [0.0, 0.0, 0.0, 1.0]
    estimate = Trajectory("estimate", truth.stamps, truth.positions + shift, turned)
    P = np.tile(np.diag([1e-4, 1e-4, 4e-4, 0.01, 0.04, 0.09]), (5, 1, 1))
    found = evaluate_consistency(estimate, truth, truth.stamps, P)
    assert len(found.stamps) == 4
    np.testing.assert_allclose(found.nees["position"], 3.0, rtol=1e-9)
    np.testing.assert_allclose(found.nees["rotation"], 1.0, rtol=1e-6)
    np.testing.assert_allclose(found.nees["pose"], 4.0, rtol=1e-6)
    assert found.shares("pose") == (0.0, 1.0, 0.0)


def test_share_within_the_bounds_is_95_percent_when_the_covariance_is_right():
    generator = np.random.default_rng(3)
    truth = straight(20001)
    sigma = np.array([0.01, 0.02, 0.03, 0.1, 0.2, 0.3])
    errors = generator.normal(size=(len(truth), 6)) * sigma
    errors[0] = 0.0
    half = errors[:, :3] / 2.0
    norms = np.linalg.norm(half, axis=1, keepdims=True)
    turn = np.hstack([half * np.sinc(norms / np.pi), np.cos(norms)])
    estimate = Trajectory("estimate", truth.stamps, truth.positions + errors[:, 3:], turn)
    P = np.tile(np.diag(sigma**2), (len(truth), 1, 1))
    below, within, above = evaluate_consistency(estimate, truth, truth.stamps, P).shares("pose")
    assert within == pytest.approx(0.95, abs=0.01)
    assert below == pytest.approx(0.025, abs=0.006)
    assert above == pytest.approx(0.025, abs=0.006)


def test_rotation_vectors_of_large_and_small_turns():
    angles = np.array([0.0, 1e-9, 0.5, 3.0])
    matrices = np.stack(
        [[[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]] for a in angles]
    )
    np.testing.assert_allclose(rotation_vectors(matrices)[:, 2], angles, atol=1e-7)


def test_bad_input_has_a_message(tmp_path):
    with pytest.raises(UserError, match="no such file"):
        read_covariances(str(tmp_path / "covariance.csv"))
    (tmp_path / "covariance.csv").write_text("stamp,c00\n1,2\n")
    with pytest.raises(UserError, match="21 numbers"):
        read_covariances(str(tmp_path / "covariance.csv"))
    result = subprocess.run(
        ["/usr/bin/python3", str(SCRIPT), "only_one"], capture_output=True, text=True, check=False
    )
    assert result.returncode != 0
    assert "pairs" in result.stderr
