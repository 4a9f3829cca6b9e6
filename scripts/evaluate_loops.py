#!/usr/bin/python3
"""Compares the loops of a run with the truth: how many are wrong, and how many revisits were found.

Each RUN is an output folder of offline_slam, of the mapping node or of optimise_session (docs/evaluation.md says what
counts as wrong and as a revisit), each TRUTH its ground truth.
"""

import argparse
from pathlib import Path

import numpy as np

from fdi_lio_scripts import errors
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.loop_evaluation import evaluate_loops, read_loops
from fdi_lio_scripts.trajectory_io import read_trajectory


def main() -> int:
    """Reads, evaluates, prints one line a run; 1 when a wrong loop was accepted."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="+", metavar="RUN TRUTH", help="run folders, each with its truth")
    parser.add_argument("--min-path", type=float, default=40.0, help="loop.min_path of the runs [m]")
    arguments = parser.parse_args()
    if len(arguments.files) % 2:
        raise UserError("give pairs: RUN TRUTH [RUN TRUTH]...")
    print(
        f"{'run':30s} {'looked at':>9s} {'accepted':>8s} {'wrong':>6s} {'worst chi2':>10s} {'median m':>8s} "
        f"{'worst m':>8s} {'revisits':>8s} {'found':>6s}"
    )
    wrong, revisits, found = 0, 0, 0
    for run, truth in zip(arguments.files[::2], arguments.files[1::2]):
        loops = read_loops(str(Path(run) / "loops.csv"))
        result = evaluate_loops(loops, read_trajectory(truth), arguments.min_path)
        worst = result.chi_squares.max() if result.accepted else 0.0
        middle = np.median(result.position_errors_m) if result.accepted else 0.0
        farthest = result.position_errors_m.max() if result.accepted else 0.0
        print(
            f"{Path(run).name[-30:]:30s} {result.candidates:9d} {result.accepted:8d} {result.wrong:6d} {worst:10.2f} "
            f"{middle:8.3f} {farthest:8.3f} {result.revisits:8d} {result.found:6d}"
        )
        wrong, revisits, found = wrong + result.wrong, revisits + result.revisits, found + result.found
    recall = f"{found / revisits:.1%}" if revisits else "-"
    print(f"wrong loops: {wrong}; revisits found: {found} of {revisits} ({recall})")
    return 1 if wrong else 0


if __name__ == "__main__":
    errors.run(main)
