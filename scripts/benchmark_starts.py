#!/usr/bin/python3
"""Measures starts in motion: recordings are begun in their middle, as a system is that is switched on while driving.

For each scenario, seed and start: the absolute trajectory error of the odometry of the first seconds, as
evaluate_trajectory.py gives it, and the speed at the start. Loop closures are off. What the rule about seeds is, is in
docs/benchmarks.md.
"""

import argparse
from pathlib import Path
from typing import Dict, List

import numpy as np

from fdi_lio_scripts import errors
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.simulated_runs import SimulatedRuns, add_arguments
from fdi_lio_scripts.trajectory import Trajectory
from fdi_lio_scripts.trajectory_io import read_trajectory

GOOD_M = 0.5
LOST_M = 5.0
SPEED_OVER_S = 0.2


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenarios", nargs="+", required=True, metavar="NAME", help="of config/scenarios")
    parser.add_argument("--seeds", nargs="+", type=int, required=True, metavar="N")
    parser.add_argument("--starts", nargs="+", type=float, required=True, metavar="S", help="in the recordings [s]")
    parser.add_argument("--duration", type=float, default=8.0, metavar="S", help="after each start [s]")
    add_arguments(parser)
    arguments = parser.parse_args()
    if min(arguments.starts) < 0.0 or arguments.duration <= 1.0:
        parser.error("--starts must not be negative, --duration must be more than 1 s")
    return arguments


class Starts:
    """Measures the starts in one recording after another."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self._arguments = arguments
        self._runs = SimulatedRuns(Path(arguments.bin), Path(arguments.output), arguments.timeout)

    def measure(self, scenario: str, seed: int) -> List[Dict[str, float]]:
        """Speed and error of each start in one recording; a start without a result has an infinite error."""
        length_s = max(self._arguments.starts) + self._arguments.duration + 1.0
        try:
            bag = self._runs.simulate(scenario, seed, length_s, {})
            truth = read_trajectory(str(bag.with_suffix(".tum")))
            return [self._measure_one(bag, truth, start_s) for start_s in self._arguments.starts]
        finally:
            self._runs.remove(scenario, seed)

    def _measure_one(self, bag: Path, truth: Trajectory, start_s: float) -> Dict[str, float]:
        result = {"start_s": start_s, "speed_mps": speed_at(truth, start_s), "ate_m": float("inf")}
        options = ["--start", start_s, "--duration", self._arguments.duration]
        for setting in self._arguments.set:
            options += ["--set", setting]
        try:
            result["ate_m"] = self._runs.odometry_ate_m(bag, truth, options)
        except UserError as error:
            print(f"{bag.stem} at {start_s:g} s: {error}", flush=True)
        return result


def speed_at(truth: Trajectory, start_s: float) -> float:
    """Mean speed of the first moments after a start [m/s]."""
    begin = np.searchsorted(truth.stamps, truth.stamps[0] + start_s)
    end = np.searchsorted(truth.stamps, truth.stamps[0] + start_s + SPEED_OVER_S)
    way = np.linalg.norm(truth.positions[end] - truth.positions[begin])
    return float(way / (truth.stamps[end] - truth.stamps[begin]))


def summary(name: str, ates: List[float]) -> str:
    """One line about the starts of a scenario."""
    known = [ate for ate in ates if np.isfinite(ate)]
    mean = float(np.exp(np.mean(np.log(known)))) if known else float("nan")
    return (f"{name:16} {len(ates):3d} starts: geometric mean {mean:.3f} m, largest {max(ates):.2f} m, "
            f"below {GOOD_M:g} m {sum(ate < GOOD_M for ate in ates)}, "
            f"above {LOST_M:g} m {sum(ate > LOST_M for ate in ates)}")


def main() -> int:
    """Measures all and prints two tables."""
    arguments = parse_arguments()
    starts = Starts(arguments)
    ates: Dict[str, List[float]] = {}
    print(f"{'scenario':16} seed  start s     m/s   ATE m", flush=True)
    for scenario in arguments.scenarios:
        for seed in arguments.seeds:
            for one in starts.measure(scenario, seed):
                print(f"{scenario:16} {seed:4d}  {one['start_s']:7.1f}  {one['speed_mps']:6.2f}  {one['ate_m']:6.3f}",
                      flush=True)
                ates.setdefault(scenario, []).append(one["ate_m"])
    for scenario, values in ates.items():
        print(summary(scenario, values))
    return 0


if __name__ == "__main__":
    errors.run(main)
