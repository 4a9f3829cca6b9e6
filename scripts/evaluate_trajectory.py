#!/usr/bin/python3
"""Judges an estimated trajectory against ground truth: ATE, rotation, RPE, KITTI's relative errors, coverage.

Reads TUM, KITTI and bag files. The formulas are in docs/evaluation.md; the defaults give the figures of
`evo_ape tum GT EST --align`.
"""

import argparse
import json
from dataclasses import replace
from typing import List

from fdi_lio_scripts import errors, tables
from fdi_lio_scripts.alignment import MODES
from fdi_lio_scripts.degeneracy_csv import read_degeneracy
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.evaluation import Evaluation, Settings, evaluate
from fdi_lio_scripts.trajectory import Trajectory
from fdi_lio_scripts.trajectory_io import SECONDS_PER_UNIT, read_trajectory


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "estimate", help="estimated trajectory: TUM, KITTI or bag (recognised from the content)"
    )
    parser.add_argument("truth", nargs="+", help="ground truth, one or more; each is evaluated by itself")
    pairing = parser.add_argument_group("pairing")
    pairing.add_argument(
        "--max-diff", type=float, default=0.01, metavar="S", help="largest time difference of a pair [s]"
    )
    pairing.add_argument(
        "--interpolate", action="store_true", help="interpolate the truth at the estimate's stamps"
    )
    pairing.add_argument(
        "--once", action="store_true", help="use each pose in one pair at most (evo does not)"
    )
    pairing.add_argument(
        "--time-offset", type=float, default=0.0, metavar="S", help="added to the estimate's stamps [s]"
    )
    pairing.add_argument(
        "--max-gap", type=float, default=1.0, metavar="S", help="longest gap that counts as covered [s]"
    )
    reading = parser.add_argument_group("reading")
    reading.add_argument("--topic", help="topic of a bag estimate, if it has several with poses")
    reading.add_argument("--truth-topic", help="topic of a bag truth, if it has several with poses")
    reading.add_argument("--kitti-times", metavar="FILE", help="stamps [s] of KITTI files, one a line")
    reading.add_argument(
        "--rate", type=float, default=10.0, metavar="HZ", help="of KITTI files without --kitti-times"
    )
    reading.add_argument(
        "--est-unit", choices=list(SECONDS_PER_UNIT), default="s", help="unit of the estimate's stamps"
    )
    reading.add_argument(
        "--gt-unit", choices=list(SECONDS_PER_UNIT), default="s", help="unit of the truth's stamps"
    )
    reading.add_argument("--sort", action="store_true", help="sort by stamp and drop repeated stamps")
    parser.add_argument(
        "--align", choices=MODES, default="se3", help="how the estimate is moved onto the truth"
    )
    parser.add_argument(
        "--delta", type=int, default=1, metavar="N", help="poses between the two ends of an RPE step"
    )
    output = parser.add_argument_group("output, besides the table on the terminal")
    output.add_argument("--markdown", metavar="FILE")
    output.add_argument("--json", metavar="FILE")
    output.add_argument("--csv", metavar="FILE")
    output.add_argument(
        "--plots", metavar="DIR", help="pictures: top and side view, errors over time and on the path"
    )
    output.add_argument(
        "--degeneracy", metavar="CSV", help="degeneracy.csv of the run: adds the FDI to the plots"
    )
    output.add_argument(
        "--camera-axes", action="store_true", help="the truth has z forward and y down (KITTI poses)"
    )
    arguments = parser.parse_args()
    for name, limit in (("max_diff", 0.0), ("rate", 1e-9), ("max_gap", 0.0), ("delta", 1)):
        if not getattr(arguments, name) >= limit:
            parser.error(f"--{name.replace('_', '-')} must be at least {limit}")
    return arguments


def read_all(arguments: argparse.Namespace) -> tuple:
    """The estimate, shifted by the time offset, and the truths."""
    common = {"kitti_times": arguments.kitti_times, "kitti_rate_hz": arguments.rate, "sort": arguments.sort}
    estimate = read_trajectory(
        arguments.estimate, topic=arguments.topic, stamp_unit=arguments.est_unit, **common
    )
    estimate = replace(estimate, stamps=estimate.stamps + arguments.time_offset)
    truths = [
        read_trajectory(path, topic=arguments.truth_topic, stamp_unit=arguments.gt_unit, **common)
        for path in arguments.truth
    ]
    return estimate, truths


def write_outputs(arguments: argparse.Namespace, evaluations: List[Evaluation]) -> None:
    """Everything that was asked for beside the table."""
    if arguments.markdown:
        errors.write_text(arguments.markdown, tables.markdown_table(evaluations))
    if arguments.csv:
        errors.write_text(arguments.csv, tables.csv_table(evaluations))
    if arguments.json:
        summaries = [evaluation.summary() for evaluation in evaluations]
        errors.write_text(arguments.json, json.dumps(summaries, indent=2) + "\n")
    if arguments.plots:
        # matplotlib takes a second to load, which a table does not need
        from fdi_lio_scripts.evaluation_plots import write_plots  # pylint: disable=import-outside-toplevel

        degeneracy = read_degeneracy(arguments.degeneracy) if arguments.degeneracy else None
        for index, evaluation in enumerate(evaluations):
            prefix = f"{index + 1}_" if len(evaluations) > 1 else ""
            for path in write_plots(evaluation, arguments.plots, degeneracy, prefix, arguments.camera_axes):
                print(f"wrote {path}")


def main() -> int:
    """Reads, evaluates, reports."""
    arguments = parse_arguments()
    if arguments.degeneracy and not arguments.plots:
        raise UserError("--degeneracy only adds to the plots: give --plots DIR too")
    estimate: Trajectory
    truths: List[Trajectory]
    estimate, truths = read_all(arguments)
    settings = Settings(
        max_diff_s=arguments.max_diff,
        interpolate=arguments.interpolate,
        once=arguments.once,
        align=arguments.align,
        rpe_delta=arguments.delta,
        max_gap_s=arguments.max_gap,
    )
    evaluations = [evaluate(estimate, truth, settings) for truth in truths]
    print(tables.text_table(evaluations), end="")
    write_outputs(arguments, evaluations)
    return 0


if __name__ == "__main__":
    errors.run(main)
