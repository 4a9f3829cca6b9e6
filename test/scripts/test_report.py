"""report.py on whole, partial and broken run folders."""

import base64
import re
from dataclasses import replace

import numpy as np
import pytest
from run_folders import write_pcd, write_run
from trajectories import helix, write_tum

from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.map_picture import raster
from fdi_lio_scripts.pcd import read_pcd


def test_whole_run_with_truth(run_script, tmp_path):
    truth = helix(300)
    estimate = replace(
        truth, positions=truth.positions + np.random.default_rng(0).normal(0, 0.05, truth.positions.shape)
    )
    run = write_run(tmp_path / "run", estimate)
    done = run_script("report.py", run, "--ground-truth", write_tum(tmp_path / "gt.tum", truth))
    assert done.returncode == 0, done.stderr
    page = (run / "report.html").read_text()
    pictures = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    assert len(pictures) == 8
    assert all(base64.b64decode(picture).startswith(b"\x89PNG") for picture in pictures)
    for words in (
        "ATE rmse [m]", "5.0 x", "412 MB", "IMU gap of 0.13 s", "x &lt; y &amp; z", "200,000 points",
        "structured",
        "25.0 %", "scan matching", "75 %", "ring_count: 64",
    ):
        assert words in page, words
    # nothing is loaded from elsewhere
    assert not re.search(r'(src|href)="(?!data:)', page) and "@import" not in page and "url(" not in page


def test_empty_run_says_what_is_missing(run_script, tmp_path):
    (tmp_path / "run").mkdir()
    done = run_script("report.py", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "run" / "report.html").read_text()
    for name in (
        "trajectory.tum",
        "map.pcd",
        "degeneracy.csv",
        "timing.json",
        "warnings.txt",
        "run.yaml",
        "ground truth",
    ):
        assert name in page


@pytest.mark.parametrize("name, content, words", [
    ("timing.json", b"{", ["timing.json", "JSON"]),
    ("degeneracy.csv", b"stamp,fdi\n1,2\n3\n", ["degeneracy.csv", "line 3"]),
    ("map.pcd", b"hello", ["map.pcd", "PCD header"]),
    (
        "map.pcd",
        b"# .PCD\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 9\nDATA binary\n123",
        ["map.pcd", "shorter"],
    ),
    (
        "map.pcd",
        b"# .PCD\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 0\nDATA ascii\n",
        ["map.pcd", "binary"],
    ),
    ("trajectory.tum", b"1 2 3\n", ["trajectory.tum", "3 columns"]),
])
def test_broken_files_are_named(run_script, tmp_path, name, content, words):
    run = write_run(tmp_path / "run", helix(50))
    (run / name).write_bytes(content)
    done = run_script("report.py", run)
    assert done.returncode == 2 and "Traceback" not in done.stderr
    for word in words:
        assert word in done.stderr


def test_missing_folder_and_truth_without_trajectory(run_script, tmp_path):
    done = run_script("report.py", tmp_path / "no")
    assert done.returncode == 2 and "no such folder" in done.stderr
    (tmp_path / "run").mkdir()
    done = run_script(
        "report.py", tmp_path / "run", "--ground-truth", write_tum(tmp_path / "gt.tum", helix())
    )
    assert done.returncode == 2 and "trajectory.tum" in done.stderr


def test_pcd_is_thinned_and_keeps_values(tmp_path):
    points = np.arange(4000, dtype=np.float32).reshape(1000, 4)
    points[7, 1] = np.nan
    write_pcd(tmp_path / "m.pcd", points)
    everything, count = read_pcd(str(tmp_path / "m.pcd"), 10_000)
    assert count == 1000 and len(everything) == 999
    np.testing.assert_array_equal(everything["intensity"], np.delete(points[:, 3], 7))
    thinned, count = read_pcd(str(tmp_path / "m.pcd"), 100)
    assert count == 1000 and len(thinned) == 100
    with pytest.raises(UserError, match="no such file"):
        read_pcd(str(tmp_path / "none.pcd"), 10)


def test_raster_takes_the_highest_or_the_mean(tmp_path):
    grid = np.array([[x, y, 0, 10] for x in range(11) for y in range(6)], dtype=np.float32)
    tower = np.array([[5, 3, 7, 30]], dtype=np.float32)
    write_pcd(tmp_path / "m.pcd", np.concatenate([grid, tower]))
    points, _ = read_pcd(str(tmp_path / "m.pcd"), 1000)
    heights, (left, right, bottom, top) = raster(points, points["z"], highest=True)
    means, _ = raster(points, points["intensity"], highest=False)
    assert np.nanmax(heights) == 7 and np.nanmax(means) == 20 and np.nanmin(means) == 10
    row, column = np.unravel_index(np.nanargmax(heights), heights.shape)
    assert left + (column + 0.5) * (right - left) / heights.shape[1] == pytest.approx(5, abs=0.05)
    assert bottom + (row + 0.5) * (top - bottom) / heights.shape[0] == pytest.approx(3, abs=0.05)
