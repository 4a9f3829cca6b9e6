#!/usr/bin/python3
"""Compares the covariance that a run stated with the error that it made: NEES of the pose (docs/evaluation.md).

Each RUN is an output folder of offline_slam or of the mapping node, each TRUTH its ground truth. 95 % of the
poses would lie within the bounds if the stated covariance were right; `above` are those where it was too small.
"""

import argparse
from pathlib import Path

import numpy as np

from fdi_lio_scripts import errors
from fdi_lio_scripts.consistency import evaluate_consistency, read_covariances
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.trajectory_io import read_trajectory


def main() -> int:
    """Reads, evaluates, prints one line a run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="+", metavar="RUN TRUTH", help="run folders, each with its truth")
    files = parser.parse_args().files
    if len(files) % 2:
        raise UserError("give pairs: RUN TRUTH [RUN TRUTH]...")
    print(
        f"{'run':30s} {'poses':>6s} {'within':>7s} {'below':>7s} {'above':>7s} {'median':>8s} "
        f"{'position':>8s} {'rotation':>8s} {'error':>8s} {'sigma':>8s}"
    )
    within = []
    for run, truth in zip(files[::2], files[1::2]):
        stamps, covariances = read_covariances(str(Path(run) / "covariance.csv"))
        found = evaluate_consistency(
            read_trajectory(str(Path(run) / "odometry.tum")), read_trajectory(truth), stamps, covariances
        )
        below, inside, above = found.shares("pose")
        within.append(inside)
        print(
            f"{Path(run).name[-30:]:30s} {len(found.stamps):6d} {inside:7.1%} {below:7.1%} {above:7.1%} "
            f"{np.median(found.nees['pose']):8.2f} {found.shares('position')[1]:8.1%} "
            f"{found.shares('rotation')[1]:8.1%} {np.sqrt(np.mean(found.position_errors_m ** 2)):8.3f} "
            f"{np.sqrt(np.mean(found.position_sigma_m ** 2)):8.3f}"
        )
    print(f"mean share within the 95 % bounds of 6 degrees of freedom: {np.mean(within):.1%}")
    return 0


if __name__ == "__main__":
    errors.run(main)
