#!/usr/bin/python3
"""Measures recordings whose sensors, mountings, IMUs, places and motions are drawn at random.

The benchmark's scenarios change one thing at a time; users bring all at once. Each number is one variation of a
scenario on a tuning seed, always the same. Printed is the absolute trajectory error of the odometry; what comes out far
worse than the others is worth a look, by --numbers with that one alone and --sim to take its settings back one by one.
"""

import argparse
from pathlib import Path
from typing import List

import numpy as np

from fdi_lio_scripts import errors
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.simulated_runs import SimulatedRuns, add_arguments
from fdi_lio_scripts.trajectory_io import read_trajectory
from fdi_lio_scripts.variations import Variation, draw


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--numbers", nargs="+", type=int, required=True, metavar="N", help="of variations")
    parser.add_argument("--duration", type=float, default=40.0, metavar="S", help="of each recording [s]")
    parser.add_argument("--sim", action="append", default=[], metavar="KEY=VALUE",
                        help="for simulate_bag, over what is drawn")
    add_arguments(parser)
    arguments = parser.parse_args()
    for setting in arguments.sim:
        if "=" not in setting:
            parser.error(f"--sim {setting}: KEY=VALUE is expected")
    return arguments


def measure(runs: SimulatedRuns, variation: Variation, arguments: argparse.Namespace) -> float:
    """ATE of one variation [m], infinite when a program fails."""
    options: List[object] = []
    for setting in arguments.set:
        options += ["--set", setting]
    try:
        bag = runs.simulate(variation.scenario, variation.seed, arguments.duration, variation.settings)
        return runs.odometry_ate_m(bag, read_trajectory(str(bag.with_suffix(".tum"))), options)
    except UserError as error:
        print(f"{variation.scenario}_{variation.seed}: {error}", flush=True)
        return float("inf")
    finally:
        runs.remove(variation.scenario, variation.seed)


def main() -> int:
    """Measures all and prints a line each."""
    arguments = parse_arguments()
    runs = SimulatedRuns(Path(arguments.bin), Path(arguments.output), arguments.timeout)
    ates: List[float] = []
    for number in arguments.numbers:
        variation = draw(number)
        variation.settings.update(dict(setting.split("=", 1) for setting in arguments.sim))
        ates.append(measure(runs, variation, arguments))
        settings = " ".join(f"{key}={value}".replace(", ", ",") for key, value in variation.settings.items())
        print(f"{number:5d}  {ates[-1]:8.3f} m  {variation.scenario} {variation.seed}  {settings}", flush=True)
    most = np.quantile(ates, 0.9, method="higher")
    print(f"{len(ates)} variations: median {np.median(ates):.3f} m, nine tenths at most {most:.3f} m, largest {max(ates):.2f} m")
    return 0


if __name__ == "__main__":
    errors.run(main)
