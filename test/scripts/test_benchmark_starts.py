"""benchmark_starts.py with stub programs in place of simulate_bag and offline_slam."""

import subprocess
from pathlib import Path
from typing import List

import pytest
from conftest import REPOSITORY

# The truth is a circle of 10 m at 5 m/s; the estimate leaves it by 0.2 m (0.7 m after 20 s) upwards and downwards in
# turn, which no alignment takes away. A start at 30 s fails.
COMMON = '''#!/usr/bin/python3
import math, pathlib, sys
arguments = dict(zip(sys.argv[1::2], sys.argv[2::2]))

def write_poses(path, begin, end, offset):
    with open(path, "w", encoding="utf-8") as out:
        for i in range(int(10 * begin), int(10 * end)):
            a = 0.05 * i
            row = (100 + 0.1 * i, 10 * math.cos(a), 10 * math.sin(a), offset * (-1) ** i, 0, 0, math.sin(a / 2),
                   math.cos(a / 2))
            out.write(" ".join(repr(float(number)) for number in row) + "\\n")
'''
SIMULATE = COMMON + '''
stem = arguments["--output"][:-len(".bag")]
write_poses(stem + ".tum", 0.0, float(arguments["--duration"]), 0.0)
for ending in (".bag", ".labels", ".config.yaml"):
    pathlib.Path(stem + ending).write_text("")
'''
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
    binaries = tmp_path / "bin"
    binaries.mkdir()
    for name, text in (("simulate_bag", SIMULATE), ("offline_slam", SLAM)):
        (binaries / name).write_text(text)
        (binaries / name).chmod(0o755)

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
