"""evaluate_degeneracy.py: rank correlation, errors, true classes and flickers with known answers."""

import json
import struct
from dataclasses import replace

import numpy as np
import pytest
from trajectories import line, write_tum

from fdi_lio_scripts.degeneracy_evaluation import class_changes, flickers, ranks, spearman
from fdi_lio_scripts.degeneracy_truth import (
    Recording, drifts_m, moving_shares, no_registration_errors, read_labels, read_registration_errors, true_classes
)
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.weak_directions import judge_directions, read_weak_translations


def test_ranks_share_the_mean_of_equal_values():
    assert ranks(np.array([3.0, 1.0, 3.0, 2.0])).tolist() == [2.5, 0.0, 2.5, 1.0]


def test_spearman_of_monotonic_pairs_is_one():
    x = np.linspace(0.1, 3, 50)
    assert spearman(x, np.exp(x)) == pytest.approx(1.0)
    assert spearman(x, -x**3) == pytest.approx(-1.0)


def test_spearman_equals_the_formula_of_rank_differences():
    random = np.random.default_rng(3)
    a, b = random.permutation(30).astype(float), random.permutation(30).astype(float)
    n, d = 30, a - b  # permutations are their own ranks
    assert spearman(a, b) == pytest.approx(1 - 6 * (d @ d) / (n * (n * n - 1)))


def test_spearman_leaves_out_what_is_unknown_and_knows_when_it_says_nothing():
    x = np.arange(5.0)
    assert spearman(x, np.array([0.0, np.nan, 2.0, 3.0, 4.0])) == pytest.approx(1.0)
    assert np.isnan(spearman(x, np.ones(5)))


def test_drift_is_the_relative_error_over_a_second():
    truth = line(30.0, 0.5)  # 10 Hz, 5 m/s
    drifting = replace(truth, positions=truth.positions * [1.02, 1, 1])
    errors = drifts_m(drifting, truth)
    assert np.isnan(errors[:5]).all() and np.isnan(errors[-5:]).all()
    np.testing.assert_allclose(errors[5:-5], 0.02 * 5.0, atol=1e-9)  # 10 steps of 0.1 s


def test_drift_of_one_jump_is_seen_by_the_scans_about_it():
    truth = line(30.0, 0.5)
    positions = truth.positions.copy()
    positions[30:, 1] += 0.3
    errors = drifts_m(replace(truth, positions=positions), truth)
    assert np.flatnonzero(np.nan_to_num(errors) > 1e-9).tolist() == list(range(25, 35))
    np.testing.assert_allclose(errors[25:35], 0.3, atol=1e-9)


def test_a_gap_in_the_odometry_has_no_drift():
    truth = line(60.0, 0.5)
    kept = np.r_[0:40, 60:121]
    errors = drifts_m(truth.take(kept), truth)
    assert np.isnan(errors[36:44]).all()
    assert np.isfinite(errors[10:34]).all()


REGISTRATION_HEADER = "stamp,error,geometric_error,x,y,z"


def test_registration_errors_find_their_scans_in_spite_of_the_clock(tmp_path):
    path = tmp_path / "a.registration.csv"
    path.write_text(f"{REGISTRATION_HEADER}\n10.203,0.5,0.6,1,0,0\n10.397,0.25,0.3,0,0,1\n")
    errors = read_registration_errors(path, 10.0 + 0.1 * np.arange(6))
    np.testing.assert_array_equal(errors.error_m, [np.nan, np.nan, 0.5, np.nan, 0.25, np.nan])
    np.testing.assert_array_equal(errors.geometric_m, [np.nan, np.nan, 0.6, np.nan, 0.3, np.nan])
    np.testing.assert_array_equal(errors.axis[[2, 4]], [[1, 0, 0], [0, 0, 1]])


@pytest.mark.parametrize("line, said", [("11.0,0.5,0.5,1,0,0", "same recording"), ("x,0.5,0.5,1,0,0", "again"),
                                        ("10.1,0.5", "2 columns")])
def test_registration_errors_of_another_recording_are_refused(tmp_path, line, said):
    path = tmp_path / "a.registration.csv"
    path.write_text(f"{REGISTRATION_HEADER}\n{line}\n")
    with pytest.raises(UserError, match=said):
        read_registration_errors(path, 10.0 + 0.1 * np.arange(6))


def turned(degrees):
    """Translation in the plane, that many degrees from x."""
    return [0, 0, 0, np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0]


def write_directions(path, scans):
    """directions.csv; each of `scans` is the probability and the direction of one axis, others are observed."""
    lines = ["stamp,axis,probability,information,noise,rx,ry,rz,tx,ty,tz"]
    for k, (probability, direction) in enumerate(scans):
        for axis in range(6):
            unit = direction if axis == 5 else np.eye(6)[axis]
            values = [probability if axis == 5 else 1, 1, 1, *unit]
            lines.append(f"{10 + 0.1 * k:.9f},{axis}," + ",".join(f"{value:.6f}" for value in values))
    path.write_text("\n".join(lines) + "\n")


def test_a_direction_is_named_within_ten_degrees_of_the_error(tmp_path):
    along_x = [1.0, 0.0, 0.0]
    scans = [
        (0.4, turned(9), 0.06),  # open, named
        (0.4, turned(171), 0.06),  # an axis has no sign
        (0.4, turned(11), 0.06),  # another direction
        (0.6, turned(0), 0.06),  # counts as observed
        (0.4, [0.8, 0, 0, 0.6, 0, 0], 0.06),  # a rotation for the greater part
        (0.4, turned(0), 0.03),  # neither open nor closed
        (0.4, turned(45), 0.01),  # false alarm
        (0.6, turned(0), 0.01),  # closed, and said so
        (0.4, turned(0), np.nan),  # nobody knows
    ]
    write_directions(tmp_path / "directions.csv", [scan[:2] for scan in scans])
    translations = read_weak_translations(tmp_path / "directions.csv", len(scans))
    errors = no_registration_errors(len(scans))
    errors.geometric_m[:] = [scan[2] for scan in scans]
    errors.axis[:] = along_x
    verdict = judge_directions(translations, errors)
    assert verdict.is_open.tolist() == 5 * [True] + 4 * [False]
    assert verdict.is_named.tolist() == [True, True] + 7 * [False]
    assert verdict.is_closed.tolist() == 6 * [False] + [True, True, False]
    assert verdict.is_alarmed.tolist() == 6 * [False] + [True, False, False]


def test_directions_of_another_run_are_refused(tmp_path):
    write_directions(tmp_path / "directions.csv", [(0.4, turned(0))])
    with pytest.raises(UserError, match="run offline_slam again"):
        read_weak_translations(tmp_path / "directions.csv", 2)
    with pytest.raises(UserError, match="no such file"):
        read_weak_translations(tmp_path / "other.csv", 2)


def write_labels(path, headers_ns, moving, total=10):
    """A label file in which the first `moving[i]` of `total` points of scan i move."""
    with open(path, "wb") as stream:
        for header, count in zip(headers_ns, moving):
            stream.write(struct.pack("<qI", header, total))
            stream.write(np.r_[np.full(count, 7), np.zeros(total - count)].astype("<i2").tobytes())
    return path


def test_labels_are_counted_scan_by_scan(tmp_path):
    path = write_labels(tmp_path / "a.labels", [10**9, 2 * 10**9], [3, 0])
    assert read_labels(path) == {10**9: 3, 2 * 10**9: 0}
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(UserError, match="cut short"):
        read_labels(path)


def test_shares_belong_to_the_scan_whose_header_comes_before():
    recording = Recording("plaza", 1.0, np.inf, {0: 5, 10**8: 20})
    shares = moving_shares(recording, np.array([0.0999, 0.1999]), np.array([50.0, 50.0]))
    np.testing.assert_allclose(shares, [0.1, 0.4])


@pytest.mark.parametrize("world, relief, moving, expected", [
    ("street", 1, 0, "structured"), ("tunnel", 1, 0, "sparse"), ("plaza", 1, 40, "dynamic"),
    ("highway", 1, 40, "mixed"), ("mine", 1, 0, "structured"), ("mine", 0.4, 0, "sparse"),
    ("street", 0.4, 5, "structured")
])
def test_class_of_world_and_movers(world, relief, moving, expected):
    truth = line(10.0, 0.5)
    headers = {int(round(1e9 * (s - 0.09))): moving for s in truth.stamps}
    classes = true_classes(Recording(world, relief, np.inf, headers), truth, truth.stamps, np.full(len(truth), 100.0))
    assert set(classes) == {expected}


def test_street_becomes_sparse_at_the_portal():
    truth = line(10.0, 0.5)
    headers = {int(round(1e9 * (s - 0.09))): 0 for s in truth.stamps}
    recording = Recording("street_tunnel", 1.0, 5.2, headers)
    classes = true_classes(recording, truth, truth.stamps, np.full(len(truth), 100.0))
    assert classes == ["structured"] * 11 + ["sparse"] * 10


def test_flickers_are_changes_that_the_surroundings_did_not_make():
    assert class_changes(list("aabba")) == 2
    assert flickers(list("aabba"), list("aaaaa")) == 2
    assert flickers(list("aabbb"), list("aaabb")) == 0
    assert flickers(list("aaaaa"), list("aabbb")) == 0


def write_judged_run(folder, fdi_of_error, classes=None, extra=""):
    """A run whose drift grows along the path, with the FDI as a function of the drift."""
    truth = line(60.0, 0.5)
    x = truth.positions[:, 0]
    estimate = replace(truth, positions=np.column_stack([x + 0.0005 * x**2, 0 * x, 0 * x]))
    run = folder / "street_1_full"
    run.mkdir()
    write_tum(folder / "street_1.tum", truth)
    write_tum(run / "odometry.tum", estimate)
    rows = ["stamp,fdi,structural,class,points" + extra]
    for i, stamp in enumerate(truth.stamps):
        name = classes[i] if classes else "structured"
        rows.append(f"{stamp:.9f},{fdi_of_error(x[i]):.6f},0.5,{name},100")
    (run / "degeneracy.csv").write_text("\n".join(rows) + "\n")
    return run, truth


def test_script_prints_the_correlation_of_a_real_recording(run_script, tmp_path):
    run, _ = write_judged_run(tmp_path, lambda x: x / 60)
    done = run_script("evaluate_degeneracy.py", run, "--json", tmp_path / "out.json")
    assert done.returncode == 0, done.stderr
    rows = json.loads((tmp_path / "out.json").read_text())
    assert [row["run"] for row in rows] == ["street_1_full", "all"]
    assert rows[-1]["spearman_drift"] == pytest.approx(1.0)
    assert "right" not in rows[-1]


def test_script_judges_the_class_of_a_simulated_recording(run_script, tmp_path):
    classes = ["structured"] * 60 + ["sparse"] + ["structured"] * 60
    run, truth = write_judged_run(tmp_path, lambda x: 1 - x / 60, classes)
    (tmp_path / "street_1.yaml").write_text("seed: 1\nscenario:\n  world:\n    type: street\n    cars: 5\n    relief: 1\n")
    headers = [int(round(1e9 * (s - 0.09))) for s in truth.stamps]
    write_labels(tmp_path / "street_1.labels", headers, [0] * len(headers))
    done = run_script("evaluate_degeneracy.py", run, "--truth", tmp_path, "--json", tmp_path / "out.json")
    assert done.returncode == 0, done.stderr
    whole = json.loads((tmp_path / "out.json").read_text())[-1]
    assert whole["spearman_drift"] == pytest.approx(-1.0)
    assert whole["right"] == pytest.approx(120 / 121)
    assert whole["flickers_per_100"] == pytest.approx(200 / 121)


def test_script_judges_by_the_registration_error(run_script, tmp_path):
    run, truth = write_judged_run(tmp_path, lambda x: x / 60)
    measured = truth.stamps[5::5]
    rows = [f"{stamp + 0.002:.9f},{0.01 * (k + 1):.6f},0.06,1,0,0" for k, stamp in enumerate(measured)]
    (tmp_path / "street_1.registration.csv").write_text("\n".join([REGISTRATION_HEADER, *rows]) + "\n")
    write_directions(run / "directions.csv", [(0.4 if k < 61 else 0.6, turned(5)) for k in range(len(truth.stamps))])
    done = run_script("evaluate_degeneracy.py", run, "--json", tmp_path / "out.json")
    assert done.returncode == 0, done.stderr
    whole = json.loads((tmp_path / "out.json").read_text())[-1]
    assert whole["spearman_registration"] == pytest.approx(1.0)
    assert whole["registration_m"] == pytest.approx(0.01 * (len(rows) + 1) / 2)
    assert whole["open_scans"] == len(rows)
    assert whole["named"] == pytest.approx(12 / 24)
    assert "24   50 %             0" in done.stdout


def test_missing_truth_is_named(run_script, tmp_path):
    run, _ = write_judged_run(tmp_path, lambda x: x / 60)
    (tmp_path / "street_1.tum").unlink()
    done = run_script("evaluate_degeneracy.py", run)
    assert done.returncode == 2
    assert "street_1_full" in done.stderr and "--truth" in done.stderr
