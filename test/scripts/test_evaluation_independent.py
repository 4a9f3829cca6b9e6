"""Metrics against second implementations, written from the definitions in another way than the package does it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from trajectories import helix, write_tum

from fdi_lio_scripts import metrics, rotations
from fdi_lio_scripts.alignment import align
from fdi_lio_scripts.evaluation import Settings, evaluate
from fdi_lio_scripts.trajectory import Trajectory

SEEDS = (1, 2, 3)


def wandering(seed: int, count: int = 3000) -> Trajectory:
    """About 1.5 km in three dimensions, at uneven speed, with rotations about all axes."""
    random = np.random.default_rng(seed)
    angles = np.cumsum(random.normal(0, 0.02, (count, 3)), axis=0)
    matrices = rotations.from_roll_pitch_yaw(0.3 * angles[:, 0], 0.3 * angles[:, 1], angles[:, 2])
    speeds = 0.5 + 0.4 * np.sin(0.01 * np.arange(count))
    steps = np.einsum("nij,nj->ni", matrices, np.column_stack([speeds, 0 * speeds, 0.1 * speeds]))
    return Trajectory("truth", 50 + 0.1 * np.arange(count), np.cumsum(steps, axis=0), rotations.from_matrices(matrices))


def drifting(truth: Trajectory, seed: int) -> Trajectory:
    """The truth with errors that grow along the way, in a frame of its own."""
    random = np.random.default_rng(100 + seed)
    drift = np.cumsum(random.normal(0, 0.02, truth.positions.shape), axis=0)
    small = np.cumsum(random.normal(0, 3e-4, truth.positions.shape), axis=0)
    turned = rotations.from_roll_pitch_yaw(*small.T) @ truth.rotation_matrices
    frame = rotations.from_roll_pitch_yaw(np.array([0.4]), np.array([-0.2]), np.array([2.0]))[0]
    return Trajectory("estimate", truth.stamps, 1.02 * (truth.positions + drift) @ frame.T + [7, -3, 2],
                      rotations.from_matrices(frame @ turned))


def homogeneous(trajectory: Trajectory) -> list:
    """4 x 4 matrices."""
    poses = []
    for position, (x, y, z, w) in zip(trajectory.positions, trajectory.quaternions):
        poses.append(np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), position[0]],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), position[1]],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), position[2]],
            [0, 0, 0, 1],
        ]))
    return poses


def devkit_errors(truth: list, estimate: list) -> list:
    """(first frame, r_err [rad/m], t_err [1/m per m], length) in the order of calcSequenceErrors of the KITTI odometry
    development kit (evaluate_odometry.cpp), from its description: every 10th frame, the first frame beyond the length, the
    error of the relative motion, the angle from the trace.
    """
    distances = [0.0]
    for before, after in zip(truth[:-1], truth[1:]):
        distances.append(distances[-1] + math.dist(before[:3, 3], after[:3, 3]))
    found = []
    for first in range(0, len(truth), 10):
        for length in (100, 200, 300, 400, 500, 600, 700, 800):
            last = next((i for i in range(first, len(truth)) if distances[i] > distances[first] + length), None)
            if last is None:
                continue
            motion_truth = np.linalg.inv(truth[first]) @ truth[last]
            motion_estimate = np.linalg.inv(estimate[first]) @ estimate[last]
            error = np.linalg.inv(motion_estimate) @ motion_truth
            angle = math.acos(max(min(0.5 * (np.trace(error[:3, :3]) - 1.0), 1.0), -1.0))
            found.append((first, angle / length, math.hypot(*error[:3, 3]) / length, length))
    return found


@pytest.mark.parametrize("seed", SEEDS)
def test_kitti_errors_are_those_of_the_development_kit(seed: int) -> None:
    truth = wandering(seed)
    estimate = drifting(truth, seed)
    expected = devkit_errors(homogeneous(truth), homogeneous(estimate))
    rows = metrics.segment_errors(estimate, truth, metrics.KITTI_LENGTHS_M)
    assert len(rows) == 9
    for row in rows:
        chosen = [error for error in expected if row.length_m in (0, error[3])]
        assert row.segments == len(chosen)
        # The angle by the arc cosine is only good to 1e-8 rad.
        assert row.rotation_deg_per_100m == pytest.approx(100 * np.degrees(np.mean([e[1] for e in chosen])), rel=1e-5)
        assert row.translation_percent == pytest.approx(100 * np.mean([e[2] for e in chosen]), rel=1e-9)


def test_kitti_segments_end_strictly_beyond_their_length() -> None:
    # Steps of exactly 1 m: a segment of 100 m ends at 101 m, as "dist[i] > dist[first] + len" says.
    truth = Trajectory("t", np.arange(112.0), np.column_stack([np.arange(112.0), np.zeros((112, 2))]),
                       np.tile([0.0, 0, 0, 1], (112, 1)))
    estimate = replace(truth, positions=2 * truth.positions)
    row = metrics.segment_errors(estimate, truth, (100.0,))[0]
    assert (row.segments, row.translation_percent) == (2, pytest.approx(101.0))  # from frames 0 and 10


def horn(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Rotation by Horn's quaternion method (JOSA A 1987): the largest eigenvector of a 4 x 4 matrix."""
    s = (source - source.mean(axis=0)).T @ (target - target.mean(axis=0))
    n = np.array([
        [s[0, 0] + s[1, 1] + s[2, 2], s[1, 2] - s[2, 1], s[2, 0] - s[0, 2], s[0, 1] - s[1, 0]],
        [0, s[0, 0] - s[1, 1] - s[2, 2], s[0, 1] + s[1, 0], s[2, 0] + s[0, 2]],
        [0, 0, -s[0, 0] + s[1, 1] - s[2, 2], s[1, 2] + s[2, 1]],
        [0, 0, 0, -s[0, 0] - s[1, 1] + s[2, 2]],
    ])
    w, x, y, z = np.linalg.eigh(n, UPLO="U")[1][:, -1]
    return homogeneous(Trajectory("q", np.zeros(1), np.zeros((1, 3)), np.array([[x, y, z, w]])))[0][:3, :3]


def rmse_after(rotation: np.ndarray, scale: float, source: np.ndarray, target: np.ndarray) -> float:
    """With the translation that makes the centroids meet."""
    rest = (target - target.mean(axis=0)) - scale * (source - source.mean(axis=0)) @ rotation.T
    return math.sqrt(np.mean(np.sum(rest**2, axis=1)))


def ate_rmse(estimate: Trajectory, truth: Trajectory, mode: str) -> float:
    return evaluate(estimate, truth, Settings(align=mode)).summary()["ate_m"]["rmse"]


@pytest.mark.parametrize("seed", SEEDS)
def test_ate_after_rigid_and_similarity_alignment(seed: int) -> None:
    truth = wandering(seed)
    estimate = drifting(truth, seed)
    p, q = estimate.positions, truth.positions
    rotation = horn(p, q)
    assert ate_rmse(estimate, truth, "se3") == pytest.approx(rmse_after(rotation, 1.0, p, q), rel=1e-9)
    a, b = (p - p.mean(axis=0)) @ rotation.T, q - q.mean(axis=0)
    scale = np.sum(a * b) / np.sum(a * a)  # the derivative of the sum of squares is zero
    assert scale == pytest.approx(1 / 1.02, abs=0.01)
    assert ate_rmse(estimate, truth, "sim3") == pytest.approx(rmse_after(rotation, scale, p, q), rel=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_ate_after_yaw_alignment_is_the_least_of_all_yaws(seed: int) -> None:
    truth = wandering(seed, 400)
    estimate = drifting(truth, seed)

    def rmse(yaw: float) -> float:
        c, s = math.cos(yaw), math.sin(yaw)
        return rmse_after(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), 1.0, estimate.positions, truth.positions)

    yaws = np.linspace(-math.pi, math.pi, 721)
    best = yaws[np.argmin([rmse(yaw) for yaw in yaws])]
    step = yaws[1] - yaws[0]
    while step > 1e-9:  # refine round the best of the grid
        best = min((best - step, best, best + step), key=rmse)
        step /= 2
    assert ate_rmse(estimate, truth, "yaw") == pytest.approx(rmse(best), rel=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_ate_after_first_pose_alignment(seed: int) -> None:
    truth = wandering(seed, 400)
    estimate = drifting(truth, seed)
    q, p = homogeneous(truth), homogeneous(estimate)
    moved = q[0] @ np.linalg.inv(p[0])
    squares = [math.dist((moved @ b)[:3, 3], a[:3, 3]) ** 2 for a, b in zip(q, p)]
    assert ate_rmse(estimate, truth, "first") == pytest.approx(math.sqrt(sum(squares) / len(squares)), rel=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("delta", [1, 7])
def test_rpe_by_homogeneous_matrices(seed: int, delta: int) -> None:
    truth = wandering(seed, 400)
    estimate = drifting(truth, seed)
    q, p = homogeneous(truth), homogeneous(estimate)
    lengths = []
    for i in range(0, len(q) - delta, delta):
        error = np.linalg.inv(np.linalg.inv(q[i]) @ q[i + delta]) @ np.linalg.inv(p[i]) @ p[i + delta]
        lengths.append(math.hypot(*error[:3, 3]))
    rpe = evaluate(estimate, truth, Settings(align="none", rpe_delta=delta)).rpe
    np.testing.assert_allclose(rpe.translation_m, lengths, rtol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_association_of_uneven_rates_by_brute_force(seed: int) -> None:
    random = np.random.default_rng(seed)
    every = helix(2000, 100.0)
    truth = every.take(np.sort(random.choice(2000, 1500, replace=False)))
    coarse = every.take(np.sort(random.choice(2000, 150, replace=False)))
    estimate = replace(coarse, stamps=coarse.stamps + random.uniform(-0.004, 0.004, 150))
    pairs = []
    for i, stamp in enumerate(estimate.stamps):
        j = min(range(len(truth)), key=lambda k, s=stamp: abs(truth.stamps[k] - s))
        if abs(truth.stamps[j] - stamp) <= 0.01:
            pairs.append((i, j))
    gaps = [math.dist(estimate.positions[i], truth.positions[j]) for i, j in pairs]
    result = evaluate(estimate, truth, Settings(align="none"))
    np.testing.assert_allclose(result.position_errors_m, gaps, atol=1e-12)


# --- input and output that issue lists name and no other test has ---


def test_nan_in_the_truth_is_named(run_script, tmp_path) -> None:
    good = write_tum(tmp_path / "e.tum", helix())
    rows = np.loadtxt(good)
    rows[4, 6] = np.inf
    np.savetxt(tmp_path / "gt.tum", rows, fmt="%.9f")
    done = run_script("evaluate_trajectory.py", good, tmp_path / "gt.tum")
    assert done.returncode == 2
    assert "gt.tum" in done.stderr and "line 5" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize("option", ["--json", "--csv", "--markdown"])
def test_a_full_disk_is_named(run_script, tmp_path, option: str) -> None:
    good = write_tum(tmp_path / "e.tum", helix())
    done = run_script("evaluate_trajectory.py", good, good, option, "/dev/full")
    assert done.returncode == 2
    assert "/dev/full" in done.stderr and "space" in done.stderr and "Traceback" not in done.stderr
