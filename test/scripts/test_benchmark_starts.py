"""benchmark_starts.py with stub programs in place of simulate_bag and offline_slam.

The estimate leaves the truth by 0.2 m (0.7 m after 20 s); a start at 30 s fails.
"""

import subprocess
from pathlib import Path
from typing import List

import pytest
from conftest import REPOSITORY
from stub_programs import COMMON, install

SLAM = COMMON + '''
start = float(arguments["--start"])
if start == 30.0:
    sys.exit("no light today")
output = pathlib.Path(arguments["--output"])
output.mkdir()
write_poses(output / "odometry.tum", start, start + float(arguments["--duration"]), 0.2 if start < 20.0 else 0.7)
'''


@pytest.fixture(name="run")
def run_fixture(tmp_path: Path):
    """Runs the script with the stubs; returns its exit code and what it printed."""
    binaries = install(tmp_path / "bin", SLAM)

    def run(*options: str, folder: Path = binaries) -> subprocess.CompletedProcess:
        return subprocess.run(
            [str(REPOSITORY / "scripts/benchmark_starts.py"), "--scenarios", "street", "--seeds", "1", "--bin",
             str(folder), "--output", str(tmp_path / "out"), *options],
            check=False, capture_output=True, text=True
        )

    return run


def rows(text: str) -> List[List[str]]:
    """The lines of single starts, split."""
    return [line.split() for line in text.splitlines() if line.startswith("street") and "starts:" not in line]


def test_error_and_speed_of_each_start(run, tmp_path: Path) -> None:
    done = run("--starts", "5", "25")
    assert done.returncode == 0, done.stderr
    first, second = rows(done.stdout)
    assert [float(x) for x in first[1:]] == [1, 5.0, pytest.approx(5.0, abs=0.02), pytest.approx(0.2, abs=0.005)]
    assert float(second[4]) == pytest.approx(0.7, abs=0.01)
    assert "2 starts: geometric mean 0.37" in done.stdout
    assert "below 0.5 m 1, above 5 m 0" in done.stdout
    assert not list((tmp_path / "out").iterdir())


def test_a_start_that_fails_counts_as_lost(run) -> None:
    done = run("--starts", "5", "30")
    assert done.returncode == 0
    assert "street_1 at 30 s: offline_slam: no light today" in done.stdout
    assert "below 0.5 m 1, above 5 m 1" in done.stdout


def test_missing_programs_and_bad_starts_are_named(run, tmp_path: Path) -> None:
    done = run("--starts", "5", folder=tmp_path)
    assert done.returncode == 2
    assert "simulate_bag: not there" in done.stderr
    assert run("--starts", "-1").returncode == 2
