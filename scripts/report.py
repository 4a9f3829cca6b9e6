#!/usr/bin/python3
"""Writes RUN_DIR/report.html: one page about a run that can be mailed, with everything inside.

Shows what RUN_DIR holds of trajectory.tum, map.pcd, degeneracy.csv, timing.json, warnings.txt and run.yaml,
and says what is missing. With --ground-truth it also shows the errors (truth interpolated at the estimate's
stamps, SE(3) alignment unless told otherwise).
"""

import argparse
from pathlib import Path
from typing import Optional

from fdi_lio_scripts import errors, html_page, report_sections
from fdi_lio_scripts.alignment import MODES
from fdi_lio_scripts.degeneracy_csv import read_degeneracy
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.evaluation import Evaluation, Settings, evaluate
from fdi_lio_scripts.trajectory import Trajectory
from fdi_lio_scripts.trajectory_io import read_trajectory


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path, metavar="RUN_DIR", help="output folder of a run")
    parser.add_argument("--ground-truth", metavar="GT", help="TUM, KITTI or bag file")
    parser.add_argument("--truth-topic", help="topic of a bag truth, if it has several with poses")
    parser.add_argument(
        "--align", choices=MODES, default="se3", help="how the estimate is moved onto the truth"
    )
    parser.add_argument("--title", help="headline; the name of the folder by default")
    parser.add_argument(
        "--output", type=Path, metavar="FILE", help="the page; RUN_DIR/report.html by default"
    )
    return parser.parse_args()


def read_estimate(run: Path) -> Optional[Trajectory]:
    """trajectory.tum of the run, if there is one."""
    file = run / "trajectory.tum"
    return read_trajectory(str(file)) if file.is_file() else None


def main() -> int:
    """Reads what exists and writes the page."""
    arguments = parse_arguments()
    run = arguments.run
    if not run.is_dir():
        raise UserError(f"{run}: no such folder: give the output folder of a run")
    trajectory = read_estimate(run)
    evaluation: Optional[Evaluation] = None
    if arguments.ground_truth:
        if trajectory is None:
            raise UserError(
                f"{run}/trajectory.tum: not found, so nothing can be compared: leave out --ground-truth"
            )
        truth = read_trajectory(arguments.ground_truth, topic=arguments.truth_topic)
        evaluation = evaluate(trajectory, truth, Settings(interpolate=True, align=arguments.align))
    degeneracy_file = run / "degeneracy.csv"
    degeneracy = read_degeneracy(str(degeneracy_file)) if degeneracy_file.is_file() else None
    timing = report_sections.read_timing(run / "timing.json")

    parts = [
        ("Summary", report_sections.summary(trajectory, timing, evaluation)),
        ("Warnings", report_sections.warnings(run / "warnings.txt")),
        ("Trajectory", report_sections.trajectory_views(trajectory, evaluation)),
        ("Map from above", report_sections.map_pictures(run / "map.pcd", trajectory)),
        ("Errors against the ground truth", report_sections.errors(evaluation, degeneracy)),
        ("Degeneracy", report_sections.degeneracy_over_time(degeneracy)),
        ("Stage times", report_sections.stage_times(timing)),
        ("Parameters", report_sections.parameters(run / "run.yaml")),
    ]
    sections = [html_page.section(title, body) for title, body in parts]
    output = arguments.output or run / "report.html"
    title = arguments.title or run.resolve().name
    output.write_text(html_page.page(f"fdi_lio run: {title}", str(run.resolve()), sections), encoding="utf-8")
    print(f"wrote {output} ({output.stat().st_size / 1e6:.1f} MB)")
    return 0


if __name__ == "__main__":
    errors.run(main)
