"""benchmark_variations.py with stub programs, and what its variations are."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY
from fdi_lio_scripts.variations import SPEEDS_MPS, TUNING_SEEDS, draw
from stub_programs import COMMON, install

# The estimate leaves the truth by 0.5 m where there is dust in the air, and there is none at all where the lidar is late.
SLAM = COMMON + '''
asked = pathlib.Path(arguments["--bag"]).read_text()
if "lidar.latency=1" in asked:
    sys.exit("too late")
output = pathlib.Path(arguments["--output"])
output.mkdir()
write_poses(output / "odometry.tum", 0.0, 20.0, 0.5 if "world.dust=0.1" in asked else 0.1)
'''


@pytest.fixture(name="run")
def run_fixture(tmp_path: Path):
    """Runs the script with the stubs; returns its exit code and what it printed."""
    binaries = install(tmp_path / "bin", SLAM)

    def run(*options: str) -> subprocess.CompletedProcess:
        return subprocess.run(
            [str(REPOSITORY / "scripts/benchmark_variations.py"), "--bin", str(binaries), "--duration", "20",
             "--output", str(tmp_path / "out"), *options],
            check=False, capture_output=True, text=True
        )

    return run


def test_the_error_of_each_variation(run, tmp_path: Path) -> None:
    done = run("--numbers", "3", "4")
    assert done.returncode == 0, done.stderr
    assert "2 variations: median 0.100 m" in done.stdout
    line = done.stdout.splitlines()[0]
    assert f"{draw(3).scenario} {draw(3).seed}" in line and "lidar.model=" in line
    assert not list((tmp_path / "out").iterdir())


def test_settings_can_be_taken_back(run) -> None:
    done = run("--numbers", "3", "--sim", "world.dust=0.1")
    assert "largest 0.50 m" in done.stdout
    assert run("--numbers", "3", "--sim", "dust").returncode == 2


def test_a_variation_that_fails_counts_as_lost(run) -> None:
    done = run("--numbers", "3", "--sim", "lidar.latency=1")
    assert done.returncode == 0
    assert "offline_slam: too late" in done.stdout
    assert "largest inf m" in done.stdout


def test_the_same_number_is_the_same_variation_and_others_differ() -> None:
    assert draw(7) == draw(7)
    drawn = [draw(number) for number in range(200)]
    assert {one.scenario for one in drawn} == set(SPEEDS_MPS)
    assert {one.seed for one in drawn} == set(TUNING_SEEDS)
    assert len({str(one.settings) for one in drawn}) == 200


def test_variations_have_keys_of_the_simulator_and_rotations_of_length_one() -> None:
    source = (REPOSITORY / "src/simulation/scenario.cpp").read_text()
    known = set(re.findall(r'\{"([a-z]+\.[A-Za-z_.]+)"', source))
    for number in range(200):
        settings = draw(number).settings
        assert set(settings) <= known
        rotation = [float(x) for x in settings["lidar.T_imu_lidar.rotation"].strip("[]").split(",")]
        assert np.linalg.norm(rotation) == pytest.approx(1.0, abs=1e-6)
