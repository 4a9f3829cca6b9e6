"""The pictures that evaluate_trajectory.py writes for one evaluation."""

from dataclasses import replace
from pathlib import Path
from typing import List, Optional

from . import plots
from .degeneracy_csv import Degeneracy
from .evaluation import Evaluation
from .trajectory import Trajectory


def robot_axes(trajectory: Trajectory) -> Trajectory:
    """Positions given in camera axes (x right, y down, z forward) in robot axes (x forward, y left, z up)."""
    return replace(trajectory, positions=trajectory.positions[:, [2, 0, 1]] * [1.0, -1.0, -1.0])


def write_plots(
    evaluation: Evaluation, directory: str, degeneracy: Optional[Degeneracy], prefix: str,
    camera_axes: bool = False
) -> List[str]:
    """Writes the pictures into `directory`, made if missing, and returns their paths.

    camera_axes: the truth is in camera axes, as KITTI's pose files are; the views are turned to robot axes.
    """
    turned = robot_axes if camera_axes else lambda trajectory: trajectory
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    start_s = evaluation.aligned.stamps[0]
    seconds = evaluation.aligned.stamps - start_s
    written: List[str] = []

    def save(figure: plots.Figure, name: str) -> None:
        written.append(str(folder / f"{prefix}{name}.png"))
        plots.save(figure, written[-1])

    for name, vertical, height in (("top_view", 1, 7.0), ("side_view", 2, 3.5)):
        figure, axes = plots.new_figure(8.0, height)
        plots.path_view(axes, vertical, turned(evaluation.aligned), turned(evaluation.truth))
        save(figure, name)

    figure, axes = plots.new_figure(8.0, 7.0)
    plots.error_on_path(axes, turned(evaluation.pairs.truth), evaluation.position_errors_m)
    save(figure, "error_on_path")

    figure, axes = plots.new_figure(9.0, 7.0 if degeneracy else 5.0, 3 if degeneracy else 2)
    plots.error_over_time(axes[0], seconds, evaluation.position_errors_m)
    plots.rotation_error_over_time(axes[1], seconds, evaluation.rotation_errors_deg)
    if degeneracy:
        plots.fdi_over_time(axes[2], degeneracy, start_s)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(seconds[0], seconds[-1])
    save(figure, "error_over_time")
    return written
