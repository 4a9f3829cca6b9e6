"""Recordings of the simulator that are made, run through offline_slam and deleted again."""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Dict, Sequence

from .benchmark_programs import Programs
from .errors import UserError
from .evaluation import Settings, evaluate
from .trajectory import Trajectory
from .trajectory_io import read_trajectory

PACKAGE = Path(__file__).resolve().parent.parent.parent
DEFAULT_BIN = PACKAGE / "build/devel/lib/fdi_lio"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of every script that makes such runs."""
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="for offline_slam")
    parser.add_argument("--output", required=True, metavar="DIR", help="folder for recordings, which are deleted")
    parser.add_argument("--bin", default=str(DEFAULT_BIN), metavar="DIR",
                        help="folder of simulate_bag and offline_slam")
    parser.add_argument("--timeout", type=float, default=600.0, metavar="S", help="of one program [s]")


class SimulatedRuns:
    """Runs simulate_bag and offline_slam of `binaries` in the folder `output`."""

    def __init__(self, binaries: Path, output: Path, timeout_s: float) -> None:
        self._binaries = binaries
        self._output = output
        self._output.mkdir(parents=True, exist_ok=True)
        self._programs = Programs(timeout_s)
        for program in ("simulate_bag", "offline_slam"):
            if not (binaries / program).is_file():
                raise UserError(f"{binaries / program}: not there: build first, or give --bin")

    def simulate(self, scenario: str, seed: int, duration_s: float, settings: Dict[str, str]) -> Path:
        """The bag of a shipped scenario with some settings of the simulator; truth and config lie beside it."""
        bag = self._output / f"{scenario}_{seed}.bag"
        command = ["simulate_bag", "--scenario", PACKAGE / "config/scenarios" / f"{scenario}.yaml", "--seed", seed,
                   "--duration", duration_s, "--output", bag]
        for key, value in settings.items():
            command += ["--set", f"{key}={value}"]
        self._run(command)
        return bag

    def remove(self, scenario: str, seed: int) -> None:
        """Deletes what `simulate` has written."""
        for left in self._output.glob(f"{scenario}_{seed}.*"):
            left.unlink()

    def odometry_ate_m(self, bag: Path, truth: Trajectory, options: Sequence[object]) -> float:
        """ATE of the odometry without loops [m]; `options` are more arguments for offline_slam."""
        with TemporaryDirectory(dir=self._output) as folder:
            run = Path(folder) / "run"
            self._run(["offline_slam", "--config", bag.with_suffix(".config.yaml"), "--bag", bag, "--output", run,
                       *options, "--set", "loop.enabled=false"])
            estimate = read_trajectory(str(run / "odometry.tum"))
            return evaluate(estimate, truth, Settings()).summary()["ate_m"]["rmse"]

    def _run(self, command: list) -> None:
        outcome = self._programs.run([self._binaries / command[0], *command[1:]])
        if outcome.exit_code != 0:
            raise UserError(f"{command[0]}: {outcome.stderr[-1] if outcome.stderr else 'no message'}")
