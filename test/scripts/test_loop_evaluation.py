"""Loops against a truth that is known in closed form."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.loop_evaluation import evaluate_loops, read_loops
from fdi_lio_scripts.trajectory import Trajectory
from fdi_lio_scripts.trajectory_io import write_tum

SCRIPT = Path(__file__).parents[2] / "scripts" / "evaluate_loops.py"
RADIUS_M = 50.0


def circle(laps: float) -> Trajectory:
    """Round a circle at 10 m a second, always looking ahead."""
    stamps = np.arange(0.0, laps * 2 * np.pi * RADIUS_M / 10.0, 0.1)
    angles = stamps * 10.0 / RADIUS_M
    positions = RADIUS_M * np.stack([np.sin(angles), 1 - np.cos(angles), 0 * angles], axis=1)
    quaternions = np.stack([0 * angles, 0 * angles, np.sin(angles / 2), np.cos(angles / 2)], axis=1)
    return Trajectory("circle", stamps, positions, quaternions)


def write_loops(path, rows):
    """rows: stamp_from, stamp_to, verdict, error [m] and sigma [m] along x of the earlier one."""
    names = ["stamp_from", "stamp_to", "source", "verdict", "tx", "ty", "tz", "qx", "qy", "qz", "qw"]
    upper = [f"c{a}{b}" for a in range(6) for b in range(a, 6)]
    lines = [",".join(names + upper)]
    for begin, end, verdict, error_m, sigma_m in rows:
        turn = (end - begin) * 10.0 / RADIUS_M
        x, y = RADIUS_M * np.sin(turn) + error_m, RADIUS_M * (1 - np.cos(turn))
        variances = {"c00": 1e-6, "c11": 1e-6, "c22": 1e-6, "c33": sigma_m ** 2, "c44": 1e-4, "c55": 1e-4}
        numbers = [x, y, 0.0, 0.0, 0.0, np.sin(turn / 2), np.cos(turn / 2)] + [variances.get(n, 0.0) for n in upper]
        lines.append(f"{begin},{end},distance,{verdict}," + ",".join(repr(float(n)) for n in numbers))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


LAP_S = 2 * np.pi * RADIUS_M / 10.0


def test_errors_are_those_that_were_made(tmp_path):
    write_loops(tmp_path / "loops.csv", [
        (1.0, 1.0 + LAP_S, "accepted", 0.0, 0.05),
        (2.0, 2.3 + LAP_S, "accepted", 0.3, 0.05),  # 0.3 m over sqrt(0.05^2 + 0.1^2)
        (3.0, 3.0 + LAP_S, "accepted", 1.0, 0.05),
        (4.0, 4.0 + LAP_S, "accepted", 7.0, 100.0),  # along a direction that it does not know
        (5.0, 5.0 + LAP_S, "few_walls", 9.0, 0.05),
    ])
    result = evaluate_loops(read_loops(str(tmp_path / "loops.csv")), circle(1.5), 40.0)
    np.testing.assert_allclose(result.position_errors_m, [0.0, 0.3, 1.0, 7.0], atol=2e-3)  # the truth is interpolated
    expected = [0.0, 0.09 / 0.0125, 1.0 / 0.0125, 49.0 / 10000.01]
    np.testing.assert_allclose(result.chi_squares, expected, rtol=3e-3, atol=2e-3)
    assert (result.candidates, result.accepted, result.wrong) == (5, 4, 1)


def test_a_wrong_turn_is_wrong(tmp_path):
    write_loops(tmp_path / "loops.csv", [(1.0, 1.0 + LAP_S, "accepted", 0.0, 0.05)])
    text = (tmp_path / "loops.csv").read_text(encoding="utf-8").splitlines()
    cells = text[1].split(",")
    cells[9], cells[10] = repr(np.sin(0.05)), repr(np.cos(0.05))  # 0.1 rad about z
    (tmp_path / "loops.csv").write_text("\n".join([text[0], ",".join(cells)]) + "\n", encoding="utf-8")
    result = evaluate_loops(read_loops(str(tmp_path / "loops.csv")), circle(1.5), 40.0)
    assert result.wrong == 1
    np.testing.assert_allclose(result.chi_squares, 0.01 / (1e-6 + np.radians(0.5) ** 2), rtol=1e-3)


def test_revisits_are_those_of_the_second_lap(tmp_path):
    truth = circle(1.5)
    second_lap_m = 0.5 * LAP_S * 10.0
    half = [(t, t + LAP_S, "accepted", 0.0, 0.05) for t in np.arange(0.0, 0.25 * LAP_S, 0.5)]
    write_loops(tmp_path / "loops.csv", half)
    result = evaluate_loops(read_loops(str(tmp_path / "loops.csv")), truth, 40.0)
    assert abs(result.revisits - second_lap_m / 5.0) <= 2
    assert abs(result.found - 0.5 * second_lap_m / 5.0) <= 2
    assert evaluate_loops([], truth, 40.0).found == 0
    assert evaluate_loops([], circle(0.9), 40.0).revisits == 0


def test_the_script_prints_a_line_and_fails_on_a_wrong_loop(tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    truth = circle(1.5)
    stamps_ns = np.round(truth.stamps * 1e9).astype(np.int64)
    write_tum(str(tmp_path / "truth.tum"), stamps_ns, truth.positions, truth.quaternions, "a circle")
    for error_m, code in ((0.0, 0), (1.0, 1)):
        write_loops(run / "loops.csv", [(1.0, 1.0 + LAP_S, "accepted", error_m, 0.05)])
        done = subprocess.run([SCRIPT, run, tmp_path / "truth.tum"], capture_output=True, text=True, check=False)
        assert done.returncode == code, done.stderr
        assert f"wrong loops: {code};" in done.stdout
    done = subprocess.run([SCRIPT, run], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "pairs" in done.stderr


def test_files_that_are_none(tmp_path):
    with pytest.raises(UserError, match="no such file"):
        read_loops(str(tmp_path / "loops.csv"))
    (tmp_path / "loops.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    with pytest.raises(UserError, match="no loops.csv"):
        read_loops(str(tmp_path / "loops.csv"))
