"""benchmark.py with stub programs in place of simulate_bag and offline_slam, and its statistics against closed forms."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any, Callable, Dict, List

import numpy as np
import pytest
from conftest import REPOSITORY

from fdi_lio_scripts import benchmark_cells as cells
from fdi_lio_scripts import benchmark_statistics as statistics
from fdi_lio_scripts.errors import UserError

# Both write a line to the log beside them for each call. The truth is a helix; the estimate leaves it by OFFSET
# metres upwards and downwards in turn, which no alignment takes away, so that the ATE is OFFSET.
COMMON = '''#!/usr/bin/python3
import json, math, pathlib, sys
arguments = dict(zip(sys.argv[1::2], sys.argv[2::2]))
sets = [value for name, value in zip(sys.argv[1:], sys.argv[2:]) if name == "--set"]
folder = pathlib.Path(sys.argv[0]).resolve().parent

def note(text):
    with open(folder / "calls.log", "a", encoding="utf-8") as log:
        log.write(text + "\\n")

def write_poses(path, offset):
    with open(path, "w", encoding="utf-8") as out:
        for i in range(400):
            a = 0.05 * i
            z = 0.3 * a + offset * (-1) ** i
            row = (100 + 0.1 * i, 10 * math.cos(a), 10 * math.sin(a), z, 0, 0, math.sin(a / 2), math.cos(a / 2))
            out.write(" ".join(repr(float(number)) for number in row) + "\\n")
'''
SIMULATE = COMMON + '''
bag = pathlib.Path(arguments["--output"])
scenario = pathlib.Path(arguments["--scenario"]).stem
note(f"simulate {scenario} {arguments['--seed']} {arguments.get('--duration', 'whole')}")
if scenario == "forest":
    sys.exit("no trees today")
stem = str(bag)[:-len(".bag")]
write_poses(stem + ".tum", 0.0)
bag.write_text(f"{scenario} {arguments['--seed']}")
pathlib.Path(stem + ".labels").write_text("")
pathlib.Path(stem + ".config.yaml").write_text("")
'''
SLAM = COMMON + '''
scenario, seed = pathlib.Path(arguments["--bag"]).read_text().split()
output = pathlib.Path(arguments["--output"])
note(f"slam {scenario} {seed} {' '.join(sets)}".rstrip())
if "mapping.crash=1" in sets and seed == "12":
    print("out of | luck", file=sys.stderr)
    sys.exit(3)
factor = 2.0 if "mapping.worse=1" in sets else 1.0
write_poses(output / "trajectory.tum", factor * 0.001 * int(seed))
stage = {"count": 400, "median": 5.0}
(output / "timing.json").write_text(json.dumps({"bag_s": 40.0, "wall_s": 4.0, "cpu_s": 8.0, "peak_memory_mb": 200.0,
                                                "stages": {"mapping": stage}}))
(output / "map.pcd").write_text("large")
'''


class Runner:
    """benchmark.py on stub programs."""

    def __init__(self, folder: Path) -> None:
        self.binaries = folder / "lib" / "fdi_lio"
        self.output = folder / "out"
        self.binaries.mkdir(parents=True)
        self.write("simulate_bag", SIMULATE)
        self.write("offline_slam", SLAM)

    def write(self, name: str, text: str) -> None:
        """Makes one of the programs."""
        (self.binaries / name).write_text(text, encoding="utf-8")
        (self.binaries / name).chmod(0o755)

    def run(self, *arguments: object) -> subprocess.CompletedProcess:
        """Runs the script as a user does; the log of calls begins anew."""
        (self.binaries / "calls.log").unlink(missing_ok=True)
        command = ["/usr/bin/python3", REPOSITORY / "scripts/benchmark.py", "--bin", self.binaries, "--output",
                   self.output, *arguments]
        environment = dict(os.environ, MPLBACKEND="Agg")
        return subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False,
                              timeout=120, env=environment)

    def calls(self, program: str) -> List[str]:
        """What a program was called for, in order."""
        log = self.binaries / "calls.log"
        lines = log.read_text(encoding="utf-8").splitlines() if log.exists() else []
        return [line.split(" ", 1)[1] for line in lines if line.startswith(program)]

    def results(self) -> Dict[str, Any]:
        """results.json."""
        return json.loads((self.output / "results.json").read_text(encoding="utf-8"))


@pytest.fixture(name="runner")
def make_runner(tmp_path: Path) -> Runner:
    """Stub programs in a folder of their own."""
    return Runner(tmp_path)


STREET = ("--scenarios", "street", "--seeds", "11-12")


# --- command line ---


@pytest.mark.parametrize("text, expected", [
    ("11", [11]), ("11-13", [11, 12, 13]), ("11,14", [11, 14]), (" 11-12, 20 ,12", [11, 12, 20]),
    ("2147483647", [2147483647]),
])
def test_seeds(text: str, expected: List[int]) -> None:
    assert cells.parse_seeds(text) == expected


@pytest.mark.parametrize("text, word", [
    ("", "no seed"), ("a", "no seed"), ("-1", "no seed"), ("1.5", "no seed"), ("11,", "no seed"),
    ("13-11", "write 11-13"), ("0-5000", "1000"), ("2147483648", "2147483647"),
])
def test_bad_seeds_are_named(text: str, word: str) -> None:
    with pytest.raises(UserError, match=word):
        cells.parse_seeds(text)


def test_configurations() -> None:
    found = cells.parse_configurations(["a=mapping.x=1 mapping.y='[1, 2]'", "b="])
    assert found == [cells.Configuration("full"), cells.Configuration("a", ("mapping.x=1", "mapping.y=[1, 2]")),
                     cells.Configuration("b")]
    assert cells.parse_configurations(["full=threads=1"]) == [cells.Configuration("full", ("threads=1",))]


@pytest.mark.parametrize("texts, word", [
    (["noequals"], "NAME="), (["a/b=x=1"], "NAME="), (["a=x"], "no key=value"), (["a=x='1"], "quotation"),
    (["a=x=1", "a=x=2"], "two configurations"),
])
def test_bad_configurations_are_named(texts: List[str], word: str) -> None:
    with pytest.raises(UserError, match=word):
        cells.parse_configurations(texts)


@pytest.mark.parametrize("arguments, word", [
    (("--scenarios", "moon"), "unknown scenario 'moon'"),
    (("--scenarios", "kitti"), "pose file"),
    (("--scenario-folder", "/nowhere"), "/nowhere: holds no scenarios"),
    (("--scenarios", "street", "--duration", "0.1"), "--duration"),
    (("--short", "--seeds", "11"), "--short"),
    (("--scenarios", "street", "--compare", "other=/nowhere"), "no folder"),
    (("--scenarios", "street", "--jobs", "0"), "--jobs"),
    (("--scenarios", "street", "--update-docs", "/nowhere/x.md"), "must hold the lines"),
])
def test_bad_command_lines_run_nothing(runner: Runner, arguments: tuple, word: str) -> None:
    done = runner.run(*arguments)
    assert done.returncode == 2
    assert word in done.stderr
    assert runner.calls("") == []


def test_programs_that_are_not_built_are_named(runner: Runner) -> None:
    (runner.binaries / "offline_slam").unlink()
    done = runner.run(*STREET)
    assert done.returncode == 2
    assert "offline_slam not found" in done.stderr


# --- cells ---


def test_every_cell_is_measured(runner: Runner) -> None:
    done = runner.run("--scenarios", "street", "corridor", "--seeds", "11-12", "--config", "worse=mapping.worse=1")
    assert done.returncode == 0, done.stderr
    assert runner.calls("simulate") == ["street 11 whole", "street 12 whole", "corridor 11 whole", "corridor 12 whole"]
    assert len(runner.calls("slam")) == 8
    results = runner.results()
    for cell in results["cells"]:
        expected = 0.001 * cell["seed"] * (2 if cell["configuration"] == "worse" else 1)
        assert cell["ok"] and cell["version"] == results["version"]
        assert cell["ate_rmse_m"] == pytest.approx(expected, rel=2e-3)
        assert cell["real_time_factor"] == 10 and cell["cpu_s_per_s"] == pytest.approx(0.2)
        assert cell["covered_share"] == pytest.approx(1.0)
    text = (runner.output / "results.md").read_text(encoding="utf-8")
    assert "| worse | **all** | 4 | 0 | 2.000 | 2.000-2.000 |" in text
    assert (runner.output / "ate.png").stat().st_size > 1000
    left = {file.suffix for file in (runner.output / "bags").iterdir()}
    assert ".bag" not in left and ".labels" not in left and ".tum" in left
    assert not list(runner.output.glob("runs/*/map.pcd"))


def test_bags_are_kept_on_request_and_used_again(runner: Runner) -> None:
    assert runner.run(*STREET, "--keep-bags").returncode == 0
    assert len(list(runner.output.glob("bags/*.bag"))) == 2
    assert runner.run(*STREET, "--config", "other=threads=1").returncode == 0
    assert runner.calls("simulate") == []
    assert runner.calls("slam") == ["street 11 threads=1", "street 12 threads=1"]


def test_finished_cells_are_not_run_again(runner: Runner) -> None:
    assert runner.run(*STREET).returncode == 0
    done = runner.run("--scenarios", "street", "--seeds", "11-13")
    assert "2 of 3 cells are finished" in done.stdout
    assert runner.calls("simulate") == ["street 13 whole"]
    assert runner.calls("slam") == ["street 13"]
    assert [cell["seed"] for cell in runner.results()["cells"]] == [11, 12, 13]
    assert runner.run(*STREET, "--fresh").returncode == 0
    assert len(runner.calls("slam")) == 2


@pytest.mark.parametrize("change", [
    lambda runner: runner.write("offline_slam", SLAM + "# changed\n"),
    lambda runner: runner.write("simulate_bag", SIMULATE + "# changed\n"),
    lambda runner: (runner.binaries.parent / "libfdi_lio_core.so").write_text("changed"),
    lambda runner: next(runner.output.glob("cells/street_11_*")).write_text("{broken"),
])
def test_cells_that_may_differ_are_run_again(runner: Runner, change: Callable[[Runner], Any]) -> None:
    assert runner.run(*STREET).returncode == 0
    change(runner)
    assert runner.run(*STREET).returncode == 0
    assert "street 11" in runner.calls("slam")


@pytest.mark.parametrize("arguments", [("--duration", "30"), ("--config", "full=threads=1"), ("--align", "yaw")])
def test_other_settings_are_other_cells(runner: Runner, arguments: tuple) -> None:
    assert runner.run(*STREET).returncode == 0
    assert runner.run(*STREET, *arguments).returncode == 0
    assert len(runner.calls("slam")) == 2


def test_another_version_with_the_same_programs_runs_nothing_and_is_named(runner: Runner) -> None:
    assert runner.run(*STREET).returncode == 0
    file = runner.output / "cells/street_11_full.json"
    record = json.loads(file.read_text(encoding="utf-8"))
    file.write_text(json.dumps({**record, "version": "v0.0.1"}), encoding="utf-8")
    assert runner.run(*STREET).returncode == 0
    assert runner.calls("slam") == []
    assert "kept from version v0.0.1" in (runner.output / "results.md").read_text(encoding="utf-8")


def test_cells_that_fail_are_listed_and_the_others_go_on(runner: Runner) -> None:
    done = runner.run("--scenarios", "street", "forest", "--seeds", "11-12", "--config", "crash=mapping.crash=1")
    assert done.returncode == 1
    text = (runner.output / "results.md").read_text(encoding="utf-8")
    assert "| street | 12 | crash | run | 3 | out of \\| luck |" in text
    assert "| forest | 11 | full | simulation | 1 | no trees today |" in text
    assert "| crash | street | 1 | 1 | 1.000 | - |" in text
    # A run that failed would fail again; a recording that could not be made is tried again.
    runner.run("--scenarios", "street", "forest", "--seeds", "11-12", "--config", "crash=mapping.crash=1")
    assert runner.calls("slam") == []
    assert runner.calls("simulate") == ["forest 11 whole", "forest 12 whole"]


def test_another_program_is_compared_with_what_it_wrote(runner: Runner, tmp_path: Path) -> None:
    assert runner.run(*STREET).returncode == 0
    other = tmp_path / "other"
    other.mkdir()
    rows = np.loadtxt(runner.output / "bags/street_11.tum")
    rows[:, 3] += 0.033 * (-1.0) ** np.arange(len(rows))
    np.savetxt(other / "street_11.tum", rows, fmt="%.12f")
    done = runner.run(*STREET, "--compare", f"other={other}")
    assert done.returncode == 1  # street_12.tum is missing
    assert runner.calls("slam") == []
    found = [cell for cell in runner.results()["cells"] if cell["configuration"] == "other"]
    assert found[0]["ate_rmse_m"] == pytest.approx(0.033, rel=2e-3)
    assert found[1]["failed_at"] == "comparison" and "street_12.tum" in found[1]["error"]
    ratio = found[0]["ate_rmse_m"] / 0.011
    text = (runner.output / "results.md").read_text(encoding="utf-8")
    assert f"| other | street | 1 | 1 | {ratio:.3f} | - |" in text


def test_the_short_run_has_its_own_scenarios(runner: Runner) -> None:
    assert runner.run("--short").returncode == 0
    assert runner.calls("simulate") == [f"{name} 11 20" for name in ("street", "tunnel", "corridor", "plaza")]


def test_scenarios_come_from_the_folder_that_is_given(runner: Runner, tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    for name in ("quarry", "harbour"):
        (folder / f"{name}.yaml").write_text("duration: 5\n", encoding="utf-8")
    assert runner.run("--scenario-folder", folder, "--seeds", "11").returncode == 0
    assert runner.calls("simulate") == ["harbour 11 whole", "quarry 11 whole"]


# --- statistics ---


def test_ratio_is_the_geometric_mean() -> None:
    ratio, low, high = statistics.geometric_mean_ratio({"a": np.log([2.0, 8.0]), "b": np.log([1.0, 1.0, 16.0])})
    assert ratio == pytest.approx(256.0 ** 0.2)
    assert low < ratio < high


def test_interval_of_equal_ratios_is_a_point() -> None:
    ratio, low, high = statistics.geometric_mean_ratio({"a": np.log([0.8, 0.8]), "b": np.log([0.8, 0.8, 0.8])})
    assert (ratio, low, high) == pytest.approx((0.8, 0.8, 0.8))


def test_interval_of_two_seeds_is_their_range() -> None:
    # Half of the resamples are a pair of equal seeds, a quarter each: beyond 2.5 % on both sides.
    _, low, high = statistics.geometric_mean_ratio({"a": np.log([0.5, 2.0])})
    assert (low, high) == pytest.approx((0.5, 2.0))


def test_interval_of_many_seeds_is_that_of_the_normal_distribution() -> None:
    logs = np.random.default_rng(5).normal(0.1, 0.3, 400)
    ratio, low, high = statistics.geometric_mean_ratio({"a": logs})
    half = 1.96 * logs.std() / np.sqrt(len(logs))
    assert np.log(ratio) == pytest.approx(logs.mean())
    assert np.log(low) == pytest.approx(logs.mean() - half, abs=0.05 * half)
    assert np.log(high) == pytest.approx(logs.mean() + half, abs=0.05 * half)


def test_interval_covers_the_true_ratio_as_often_as_it_says() -> None:
    random = np.random.default_rng(6)
    covered = 0
    for _ in range(200):
        _, low, high = statistics.geometric_mean_ratio({"a": random.normal(0.2, 0.5, 40)})
        covered += low <= np.exp(0.2) <= high
    assert 0.88 <= covered / 200 <= 0.985  # 0.95 - 0.01 for 40 samples, give or take four standard deviations


def test_resampling_stays_within_the_scenarios() -> None:
    # Between scenarios the ratios differ by 100, within one they do not: no interval.
    ratio, low, high = statistics.geometric_mean_ratio({"a": np.log([10.0, 10.0]), "b": np.log([0.1, 0.1])})
    assert (ratio, low, high) == pytest.approx((1.0, 1.0, 1.0))


def test_a_single_seed_has_no_interval_and_no_cell_no_ratio() -> None:
    assert statistics.geometric_mean_ratio({"a": np.log([3.0])}) == (pytest.approx(3.0), None, None)
    assert statistics.geometric_mean_ratio({"a": np.array([])}) == (None, None, None)
