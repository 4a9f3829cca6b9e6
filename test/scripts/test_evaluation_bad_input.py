"""Bad trajectories: each gets a message that says what, where and what to do, code 2 and no traceback."""

import numpy as np
import pytest
from trajectories import helix, write_tum


@pytest.fixture
def truth(tmp_path):
    return write_tum(tmp_path / "gt.tum", helix())


def rows_of(trajectory):
    return np.column_stack([trajectory.stamps, trajectory.positions, trajectory.quaternions])


def refused(done, *words):
    assert done.returncode == 2, done.stdout
    assert "Traceback" not in done.stderr
    assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1
    for word in words:
        assert word in done.stderr, done.stderr


def test_missing_file(run_script, truth, tmp_path):
    refused(run_script("evaluate_trajectory.py", tmp_path / "none.tum", truth), "none.tum", "no such file")


@pytest.mark.parametrize("text", ["", "# stamp tx ty tz qx qy qz qw\n\n"])
def test_empty_file(run_script, truth, tmp_path, text):
    (tmp_path / "e.tum").write_text(text)
    refused(run_script("evaluate_trajectory.py", tmp_path / "e.tum", truth), "e.tum", "no poses")


def test_unsorted_stamps_and_the_way_out(run_script, truth, tmp_path):
    rows = rows_of(helix())
    rows[[20, 21]] = rows[[21, 20]]
    np.savetxt(tmp_path / "e.tum", rows, fmt="%.9f")
    refused(run_script("evaluate_trajectory.py", tmp_path / "e.tum", truth), "goes back", "line 22", "--sort")
    assert run_script("evaluate_trajectory.py", tmp_path / "e.tum", truth, "--sort").returncode == 0


def test_repeated_stamps(run_script, truth, tmp_path):
    rows = rows_of(helix())
    rows[21, 0] = rows[20, 0]
    np.savetxt(tmp_path / "e.tum", rows, fmt="%.9f")
    refused(run_script("evaluate_trajectory.py", tmp_path / "e.tum", truth), "repeats", "line 22")


def test_no_common_time(run_script, truth, tmp_path):
    estimate = write_tum(tmp_path / "e.tum", helix(start_s=500))
    refused(run_script("evaluate_trajectory.py", estimate, truth), "share no time", "500.000")


@pytest.mark.parametrize("factor, start, words", [
    (1e9, 1.6e9, ["nanoseconds since 1970", "--est-unit ns"]),
    (1e3, 1.6e9, ["milliseconds since 1970", "--est-unit ms"]),
    (1.0, 1.6e9, ["seconds since 1970", "start of a recording"]),
])
def test_mixed_time_bases(run_script, truth, tmp_path, factor, start, words):
    rows = rows_of(helix())
    rows[:, 0] = (rows[:, 0] + start) * factor
    np.savetxt(tmp_path / "e.tum", rows, fmt="%.9f")
    refused(run_script("evaluate_trajectory.py", tmp_path / "e.tum", truth), "mixed time bases", *words)


def test_nanosecond_stamps_can_be_named(run_script, tmp_path):
    rows = rows_of(helix(start_s=1.6e9))
    np.savetxt(tmp_path / "gt.tum", rows, fmt="%.9f")
    rows[:, 0] *= 1e9
    np.savetxt(tmp_path / "e.tum", rows, fmt="%.9f")
    done = run_script("evaluate_trajectory.py", tmp_path / "e.tum", tmp_path / "gt.tum", "--est-unit", "ns")
    assert done.returncode == 0, done.stderr


def test_fewer_than_three_matches(run_script, truth, tmp_path):
    rows = rows_of(helix())
    rows[2:, 0] += 0.05
    np.savetxt(tmp_path / "e.tum", rows, fmt="%.9f")
    refused(
        run_script("evaluate_trajectory.py", tmp_path / "e.tum", truth), "only 2 poses match", "--interpolate"
    )


def test_nan_pose(run_script, truth, tmp_path):
    rows = rows_of(helix())
    rows[7, 2] = np.nan
    np.savetxt(tmp_path / "e.tum", rows, fmt="%.9f")
    refused(run_script("evaluate_trajectory.py", tmp_path / "e.tum", truth), "NaN", "line 8")


@pytest.mark.parametrize("quaternion", [[0, 0, 0, 0], [1, 1, 0, 1]])
def test_quaternion_that_is_no_rotation(run_script, truth, tmp_path, quaternion):
    rows = rows_of(helix())
    rows[7, 4:] = quaternion
    np.savetxt(tmp_path / "e.tum", rows, fmt="%.9f")
    refused(run_script("evaluate_trajectory.py", tmp_path / "e.tum", truth), "quaternion at line 8")


def test_cut_line_and_words_and_columns(run_script, truth, tmp_path):
    good = "\n".join(" ".join(f"{v:.6f}" for v in row) for row in rows_of(helix()))
    for text, words in (
        (good + "\n120.0 1 2", ["line 201", "3 numbers"]),
        (good + "\nhello world", ["line 201", "no row of numbers"]),
        ("1 2 3 4\n" * 5, ["4 columns", "TUM has 8"]),
        ("1 2 3 4 5 6 7 8 9 10 11 12\n" * 5, ["line 1", "no rotation matrix"]),
    ):
        (tmp_path / "e.tum").write_text(text)
        refused(run_script("evaluate_trajectory.py", tmp_path / "e.tum", truth), *words)


def test_binary_and_broken_bag(run_script, truth, tmp_path):
    (tmp_path / "e.bin").write_bytes(bytes(range(256)))
    refused(run_script("evaluate_trajectory.py", tmp_path / "e.bin", truth), "neither text nor a ROS bag")
    (tmp_path / "e.bag").write_bytes(b"#ROSBAG V2.0\nnothing more")
    refused(run_script("evaluate_trajectory.py", tmp_path / "e.bag", truth), "e.bag")


def test_output_folder_that_is_missing(run_script, truth, tmp_path):
    done = run_script("evaluate_trajectory.py", truth, truth, "--json", tmp_path / "no" / "such" / "t.json")
    refused(done, "t.json")


def test_degeneracy_without_its_columns(run_script, truth, tmp_path):
    (tmp_path / "d.csv").write_text("time,value\n1,2\n")
    done = run_script(
        "evaluate_trajectory.py", truth, truth, "--plots", tmp_path / "p", "--degeneracy", tmp_path / "d.csv"
    )
    refused(done, "no column 'stamp'")
