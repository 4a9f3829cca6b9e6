#!/usr/bin/python3
"""Judges the degeneracy of runs against the truth: does a high FDI mean a large error, and is the class right?

Takes output folders of offline_slam and the files that simulate_bag wrote beside the recordings (STEM.tum, and for the
classes STEM.yaml and STEM.labels) and evaluate_registration (STEM.registration.csv); a run belongs to the STEM with
which its name begins. Prints, for each run and over all scans of all runs, Spearman's rank correlation of the FDI with
the registration error of the scan and with the drift over a second about it, the share of scans with the right class,
changes of the class beyond the true ones per 100 scans, and in how many of the scans whose surfaces leave a direction
open it is named. docs/degeneracy.md defines errors, true class and open scans.

    scripts/evaluate_degeneracy.py out/runs/* --truth out/bags
"""

import argparse
import json
from pathlib import Path

from fdi_lio_scripts import errors
from fdi_lio_scripts.degeneracy_evaluation import figures, judge_run, summary, text_table


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN_DIR", help="output folders of offline_slam")
    parser.add_argument(
        "--truth", type=Path, metavar="DIR", help="folder of the truth files (default: beside each run)"
    )
    parser.add_argument("--json", metavar="FILE", help="write all figures")
    return parser.parse_args()


def main() -> int:
    """Reads, judges, reports."""
    arguments = parse_arguments()
    runs = [judge_run(run, arguments.truth) for run in arguments.runs]
    rows = [figures(run) for run in runs] + [summary(runs)]
    print(text_table(rows), end="")
    if arguments.json:
        errors.write_text(arguments.json, json.dumps(rows, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    errors.run(main)
