"""Metrics against cases that can be worked out by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest
from trajectories import helix, line, moved, write_tum

from fdi_lio_scripts import metrics
from fdi_lio_scripts.alignment import align, umeyama
from fdi_lio_scripts.association import associate, nearest_indices
from fdi_lio_scripts.evaluation import Settings, evaluate
from fdi_lio_scripts.trajectory import Trajectory


@pytest.mark.parametrize("mode, scale, axis", [
    ("se3", 1.0, [1, 2, 3]), ("sim3", 1.7, [1, 2, 3]), ("yaw", 1.0, [0, 0, 1]), ("first", 1.0, [3, -1, 1])
])
def test_alignment_undoes_a_known_transform(mode, scale, axis):
    truth = helix()
    result = evaluate(moved(truth, scale, axis, 1.1, np.array([5, -7, 2])), truth, Settings(align=mode))
    assert result.position_errors_m.max() < 1e-12
    assert result.rotation_errors_deg.max() < 1e-6
    assert result.alignment.scale == pytest.approx(1 / scale, rel=1e-12)


def test_alignment_never_reflects():
    truth = helix()
    mirrored = truth.positions * [1, 1, -1]
    assert np.linalg.det(umeyama(mirrored, truth.positions, with_scale=False).rotation) == pytest.approx(1.0)


def test_umeyama_is_the_minimum():
    random = np.random.default_rng(3)
    truth = helix()
    noisy = replace(truth, positions=truth.positions + random.normal(0, 0.5, truth.positions.shape))
    best = metrics.position_errors_m(align(noisy, truth, "se3").apply(noisy), truth)
    for _ in range(20):
        aligned = align(noisy, truth, "se3").apply(noisy)
        nudged = moved(aligned, 1.0, random.normal(size=3), 1e-3, random.normal(0, 1e-3, 3))
        assert np.sum(metrics.position_errors_m(nudged, truth) ** 2) > np.sum(best**2)


def test_unaligned_constant_offset_gives_its_length():
    truth = helix(10)
    estimate = replace(truth, positions=truth.positions + [3, 4, 0])
    ate = evaluate(estimate, truth, Settings(align="none")).summary()["ate_m"]
    expected = {"rmse": 5, "mean": 5, "median": 5, "std": 0, "min": 5, "max": 5, "sse": 250}
    assert ate == pytest.approx(expected, abs=1e-12)


def test_statistics_are_those_of_the_field():
    values = metrics.statistics(np.array([1.0, 2.0, 3.0, 6.0]))
    expected = {
        "rmse": np.sqrt(12.5), "mean": 3, "median": 2.5, "std": np.sqrt(3.5), "min": 1, "max": 6, "sse": 50
    }
    assert values == pytest.approx(expected)


def test_constant_rotation_error_in_degrees():
    truth = helix(20)
    half = np.radians(2.0) / 2
    # turned about the body's own x axis: q = q_truth * (sin, 0, 0, cos)
    x, y, z, w = truth.quaternions.T
    s, c = np.sin(half), np.cos(half)
    turned = np.column_stack([w * s + x * c, y * c + z * s, z * c - y * s, w * c - x * s])
    result = evaluate(replace(truth, quaternions=turned), truth, Settings(align="none"))
    np.testing.assert_allclose(result.rotation_errors_deg, 2.0, atol=1e-9)
    # Relative rotation is R_x' (motion) R_x: not zero, since the axis of the error does not turn with the
    # motion
    assert result.summary()["ate_m"]["max"] == 0


def test_rpe_of_a_scaled_line():
    truth = line(100, 1.0)
    estimate = line(100, 1.0, scale=1.01)
    for delta, expected, count in ((1, 0.01, 100), (10, 0.1, 10), (7, 0.07, 14)):
        rpe = evaluate(estimate, truth, Settings(align="none", rpe_delta=delta)).rpe
        np.testing.assert_allclose(rpe.translation_m, expected, atol=1e-12)
        assert len(rpe.translation_m) == count


def test_one_percent_of_scale_is_one_percent_of_kitti_error():
    # Segments end one pose past their length, so with 0.25 m steps they are 0.25 m longer than their nominal
    # length.
    truth, estimate = line(1000, 0.25), line(1000, 0.25, scale=1.01)
    result = evaluate(estimate, truth, Settings())
    assert [row.length_m for row in result.kitti] == [100, 200, 300, 400, 500, 600, 700, 800, 0]
    for row in result.kitti[:-1]:
        assert row.translation_percent == pytest.approx(1.0 * (row.length_m + 0.25) / row.length_m, rel=1e-9)
        assert row.rotation_deg_per_100m == pytest.approx(0, abs=1e-9)
        # 4001 poses, starts 0, 10, ..., the last of which must leave length + 0.25 m
        assert row.segments == int((4000 - (row.length_m * 4 + 1)) // 10) + 1
    mean = sum(
        row.translation_percent * row.segments for row in result.kitti[:-1]
    ) / result.kitti[-1].segments
    assert result.kitti[-1].translation_percent == pytest.approx(mean)
    assert result.short_segments == []


def test_yaw_drift_in_degrees_for_100_m():
    rate = np.radians(0.5) / 100  # 0.5 degrees each 100 m
    result = evaluate(line(1000, 0.5, yaw_per_m=rate), line(1000, 0.5), Settings(align="none"))
    # segments end up to one step late
    assert result.kitti[-1].rotation_deg_per_100m == pytest.approx(0.5, rel=5e-3)


def test_short_paths_get_short_segments():
    result = evaluate(line(60, 0.1, scale=1.02), line(60, 0.1), Settings())
    assert result.kitti == []
    assert [row.length_m for row in result.short_segments] == [10, 20, 50, 0]
    assert result.short_segments[0].translation_percent == pytest.approx(2.0, rel=0.02)
    assert evaluate(line(5, 0.1), line(5, 0.1), Settings()).short_segments == []


def test_association_takes_the_nearest_stamp_within_the_limit():
    def at(stamps):
        poses = helix(len(stamps))
        return Trajectory("t", np.array(stamps, float), poses.positions, poses.quaternions)

    pairs = associate(at([1.0, 2.0, 3.0, 4.0]), at([0.995, 1.996, 2.0, 3.02, 4.009]), 0.01, False, False)
    assert pairs.estimate.stamps.tolist() == [1.0, 2.0, 4.0]
    assert pairs.truth.stamps.tolist() == [0.995, 2.0, 4.009]


def test_association_reuses_poses_as_evo_does_unless_told_not_to():
    def at(stamps):
        poses = helix(len(stamps))
        return Trajectory("t", np.array(stamps, float), poses.positions, poses.quaternions)

    estimate = at([1.0, 1.004, 2.0, 3.0])
    truth = at([1.003, 2.0, 3.0, 7.0, 8.0])
    pairs = associate(estimate, truth, 0.01, False, once=False)
    assert (len(pairs.estimate), pairs.reused) == (4, 1)
    pairs = associate(estimate, truth, 0.01, False, once=True)
    assert pairs.estimate.stamps.tolist() == [1.004, 2.0, 3.0]


def test_nearest_indices_against_brute_force():
    random = np.random.default_rng(5)
    among = np.sort(random.uniform(0, 10, 50))
    stamps = random.uniform(-1, 11, 200)
    brute = np.argmin(np.abs(among[None] - stamps[:, None]), axis=1)
    np.testing.assert_array_equal(nearest_indices(stamps, among), brute)


def test_interpolation_follows_a_line_and_a_turn():
    truth = line(10, 1.0, yaw_per_m=0.1)
    x = np.array([0.25, 3.5, 9.9])
    estimate = Trajectory("e", x / 10, np.column_stack([x, 0 * x, 0 * x]),
                          np.column_stack([0 * x, 0 * x, np.sin(0.05 * x), np.cos(0.05 * x)]))
    result = evaluate(estimate, truth, Settings(interpolate=True, align="none"))
    assert result.position_errors_m.max() < 1e-12
    assert result.rotation_errors_deg.max() < 1e-6


def test_coverage_counts_gaps_and_missing_ends():
    truth = helix(101)  # 10 s
    kept = np.r_[10:41, 61:101]  # 1.0-4.0 s and 6.1-10.0 s
    result = evaluate(truth.take(kept), truth, Settings())
    assert result.covered_share == pytest.approx(0.69)
    assert result.longest_gap_s == pytest.approx(2.1)


def test_command_line_writes_every_output(run_script, tmp_path):
    truth = helix(400)
    random = np.random.default_rng(7)
    noisy = replace(truth, positions=truth.positions + random.normal(0, 0.1, truth.positions.shape))
    poses = {"est.tum": noisy, "gt.tum": truth, "gt2.tum": noisy}
    paths = [write_tum(tmp_path / name, trajectory) for name, trajectory in poses.items()]
    degeneracy = tmp_path / "degeneracy.csv"
    rows = [f"{stamp},0.5,{'sparse' if stamp < 110 else 'mixed'}\n" for stamp in truth.stamps]
    degeneracy.write_text("stamp,fdi,class\n" + "".join(rows))
    done = run_script(
        "evaluate_trajectory.py", *paths, "--markdown", tmp_path / "t.md", "--json", tmp_path / "t.json",
        "--csv", tmp_path / "t.csv", "--plots", tmp_path / "plots", "--degeneracy", degeneracy,
    )
    assert done.returncode == 0, done.stderr
    results = json.loads((tmp_path / "t.json").read_text())
    expected = evaluate(noisy, truth, Settings())
    rmse = metrics.statistics(expected.position_errors_m)["rmse"]
    assert results[0]["ate_m"]["rmse"] == pytest.approx(rmse, rel=1e-12)
    assert results[1]["ate_m"]["rmse"] == pytest.approx(0, abs=1e-9)
    assert "| ATE rmse [m] |" in (tmp_path / "t.md").read_text()
    assert len((tmp_path / "t.csv").read_text().splitlines()) == 3
    pictures = sorted(path.name for path in (tmp_path / "plots").iterdir())
    names = ("error_on_path", "error_over_time", "side_view", "top_view")
    assert pictures == [f"{i}_{name}.png" for i in (1, 2) for name in names]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in (tmp_path / "plots").iterdir())


def test_kitti_files_and_times(run_script, tmp_path):
    truth = line(300, 1.0)
    rows = np.concatenate([truth.rotation_matrices, truth.positions[:, :, None]], axis=2).reshape(-1, 12)
    np.savetxt(tmp_path / "gt.txt", rows)
    np.savetxt(tmp_path / "times.txt", truth.stamps)
    estimate = write_tum(tmp_path / "est.tum", line(300, 1.0, scale=1.01))
    for options in ([], ["--kitti-times", tmp_path / "times.txt"]):
        done = run_script(
            "evaluate_trajectory.py", estimate, tmp_path / "gt.txt", "--json", tmp_path / "r.json", *options
        )
        assert done.returncode == 0, done.stderr
        row = json.loads((tmp_path / "r.json").read_text())[0]["kitti_segments"][0]
        assert row["translation_percent"] == pytest.approx(1.01, abs=1e-6)  # 101 m of a nominal 100 m
