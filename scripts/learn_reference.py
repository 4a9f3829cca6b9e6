#!/usr/bin/python3
"""Learns the reference distributions of the degeneracy's sub-factors from your own runs.

Give the output folders of offline_slam for recordings in surroundings that count as usual for you: a sub-factor that
later differs from them gains weight in the FDI. Include the file that is written in your configuration:

    scripts/learn_reference.py out/street out/yard --output config/my_reference.yaml
    # my_robot.yaml:  include: [vlp16.yaml, my_reference.yaml]
"""

import argparse
from pathlib import Path

from fdi_lio_scripts import errors
from fdi_lio_scripts.degeneracy_csv import read_degeneracy
from fdi_lio_scripts.reference_learning import learn, parameter_file


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN_DIR", help="output folders of offline_slam")
    parser.add_argument("--output", required=True, metavar="FILE", help="parameter file (YAML) to write")
    parser.add_argument("--bins", type=int, default=10, metavar="B", help="bins over [0, 1]")
    arguments = parser.parse_args()
    if not 2 <= arguments.bins <= 1000:
        parser.error("--bins must be 2 to 1000")
    return arguments


def main() -> int:
    """Reads, learns, writes."""
    arguments = parse_arguments()
    references = learn(arguments.runs, arguments.bins)
    scans = sum(len(read_degeneracy(str(run / "degeneracy.csv")).stamps) for run in arguments.runs)
    errors.write_text(arguments.output, parameter_file(references, scans, arguments.runs))
    print(f"wrote {arguments.output} from {scans} scans of {len(arguments.runs)} runs")
    return 0


if __name__ == "__main__":
    errors.run(main)
