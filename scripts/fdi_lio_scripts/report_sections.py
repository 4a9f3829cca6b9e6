"""The sections of the report of a run. Each takes what exists and says what is missing."""

import json
from pathlib import Path
from typing import Any, Dict, List, Optional

import numpy as np

from . import html_page, plots, tables
from .degeneracy_csv import Degeneracy
from .errors import UserError
from .evaluation import Evaluation
from .map_picture import draw_map
from .pcd import read_pcd
from .trajectory import Trajectory

MAX_MAP_POINTS = 4_000_000
MAX_METRIC_PANELS = 24
SUB_FACTORS = ("structural", "sparse", "dynamic")
STAGE_COLUMNS = ("count", "mean", "median", "p95", "p99", "max")


def read_timing(file: Path) -> Optional[Dict[str, Any]]:
    """timing.json, or None if the run wrote none."""
    if not file.is_file():
        return None
    try:
        timing = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise UserError(f"{file}: is no valid JSON ({error}): was it cut off while saving?") from None
    if not isinstance(timing, dict):
        raise UserError(f"{file}: holds no timing of a run")
    return timing


def summary(
    trajectory: Optional[Trajectory], timing: Optional[Dict[str, Any]], evaluation: Optional[Evaluation]
) -> str:
    """The figures that a reader wants first."""
    items: List[tuple] = []
    if trajectory is not None:
        items.append((f"{len(trajectory)}", "scans"))
        items.append((f"{trajectory.duration_s:.1f} s", "duration"))
        items.append((f"{trajectory.distances_m()[-1]:.1f} m", "path length"))
        gap = float(np.linalg.norm(trajectory.positions[-1] - trajectory.positions[0]))
        items.append((f"{gap:.2f} m", "from start to end"))
    if evaluation is not None:
        items.append((f"{evaluation.summary()['ate_m']['rmse']:.3f} m", "ATE rmse"))
    if timing is not None:
        wall, bag = timing.get("wall_s"), timing.get("bag_s")
        if wall and bag:
            items.append((f"{bag / wall:.1f} x", "real time"))
        if timing.get("cpu_s") and bag:
            items.append((f"{timing['cpu_s'] / bag:.2f}", "CPU s per s of data"))
        if timing.get("peak_memory_mb"):
            items.append((f"{timing['peak_memory_mb']:.0f} MB", "peak memory"))
    return html_page.facts(items) if items else html_page.missing(
        "Neither trajectory.tum nor timing.json was found."
    )


def warnings(file: Path) -> str:
    """warnings.txt, one a line."""
    if not file.is_file():
        return html_page.missing("No warnings.txt was written.")
    lines = [line for line in file.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
    if not lines:
        return '<p class="fine">No warnings.</p>\n'
    return "".join(f'<p class="warning">{html_page.text(line)}</p>\n' for line in lines)


def trajectory_views(trajectory: Optional[Trajectory], evaluation: Optional[Evaluation]) -> str:
    """Top and side view; with the truth, in its frame."""
    if trajectory is None:
        return html_page.missing("trajectory.tum was not found.")
    shown = evaluation.aligned if evaluation else trajectory
    truth = evaluation.truth if evaluation else None
    body = ""
    for vertical, height, name in ((1, 6.5, "top view"), (2, 3.0, "side view")):
        figure, axes = plots.new_figure(10.0, height)
        plots.path_view(axes, vertical, shown, truth)
        body += html_page.picture(figure, f"trajectory, {name}")
    return body


def map_pictures(file: Path, trajectory: Optional[Trajectory]) -> str:
    """The map from above by height and by intensity."""
    if not file.is_file():
        return html_page.missing("map.pcd was not found.")
    points, count = read_pcd(str(file), MAX_MAP_POINTS)
    if len(points) == 0:
        return html_page.missing("map.pcd holds no points.")
    shown = f", of which {len(points):,} are shown" if len(points) < count else ""
    body = f"<p>{count:,} points{shown}. The white line is the path.</p>\n"
    for field, label in (("z", "height of the highest point [m]"), ("intensity", "mean intensity")):
        if field not in points.dtype.names:
            body += html_page.missing(f"map.pcd has no field {field}.")
            continue
        figure, axes = plots.new_figure(10.0, 8.0)
        # The height shows where the path runs; the other picture is left without it, so that road paint can
        # be seen.
        draw_map(axes, points, field, label, trajectory if field == "z" else None)
        body += html_page.picture(figure, f"map coloured by {label}")
    return body


def errors(evaluation: Optional[Evaluation], degeneracy: Optional[Degeneracy]) -> str:
    """Errors against the truth."""
    if evaluation is None:
        return html_page.missing(
            "No ground truth was given (--ground-truth), so there are no errors to show."
        )
    body = "".join(f"<p>{html_page.text(note)}</p>\n" for note in tables.notes([evaluation]))
    seconds = evaluation.aligned.stamps - evaluation.aligned.stamps[0]
    figure, axes = plots.new_figure(10.0, 6.0 if degeneracy else 4.2, 3 if degeneracy else 2)
    plots.error_over_time(axes[0], seconds, evaluation.position_errors_m)
    plots.rotation_error_over_time(axes[1], seconds, evaluation.rotation_errors_deg)
    if degeneracy is not None:
        plots.fdi_over_time(axes[2], degeneracy, evaluation.aligned.stamps[0])
    axes[-1].set_xlabel("time [s]")
    body += html_page.picture(figure, "errors over time")
    figure, axes = plots.new_figure(10.0, 6.5)
    plots.error_on_path(axes, evaluation.pairs.truth, evaluation.position_errors_m)
    body += html_page.picture(figure, "position error on the path")
    rows = [[label] + cells for label, cells in tables.result_rows([evaluation])]
    return body + html_page.table(["", Path(evaluation.truth.name).name], rows)


def degeneracy_over_time(degeneracy: Optional[Degeneracy]) -> str:
    """FDI, classes, sub-factors and all other columns."""
    if degeneracy is None:
        return html_page.missing("degeneracy.csv was not found.")
    if len(degeneracy.stamps) == 0:
        return html_page.missing("degeneracy.csv holds no rows.")
    start_s = degeneracy.stamps[0]
    present = [name for name in SUB_FACTORS if name in degeneracy.others]
    figure, axes = plots.new_figure(10.0, 4.6 if present else 2.6, 2 if present else 1)
    panels = np.atleast_1d(axes)
    plots.fdi_over_time(panels[0], degeneracy, start_s)
    if present:
        plots.sub_factors_over_time(panels[1], degeneracy, present, start_s)
    panels[-1].set_xlabel("time [s]")
    body = html_page.picture(figure, "FDI, class and sub-factors over time")
    body += f"<p>FDI: mean {degeneracy.fdi.mean():.3f}, highest {degeneracy.fdi.max():.3f}.</p>\n"
    names = [name for name in dict.fromkeys(degeneracy.classes) if name]
    if names:
        shares = [
            [
                name, f"{100 * degeneracy.classes.count(name) / len(degeneracy.classes):.1f} %"
            ] for name in names
        ]
        body += html_page.table(["environment class", "share of scans"], shares)
    # Columns that never change say nothing as a picture.
    changing = {
        name: values for name, values in degeneracy.others.items()
        if name not in SUB_FACTORS and np.isfinite(values).any() and np.nanmax(values) > np.nanmin(values)
    }
    if changing:
        chosen = dict(list(changing.items())[:MAX_METRIC_PANELS])
        if len(changing) > len(chosen):
            body += f"<p>The first {len(chosen)} of {len(changing)} further columns:</p>\n"
        body += html_page.picture(
            plots.small_multiples(chosen, degeneracy.stamps - start_s), "further metrics"
        )
    return body


def stage_times(timing: Optional[Dict[str, Any]]) -> str:
    """The table of stage times."""
    if timing is None:
        return html_page.missing("timing.json was not found.")
    stages = timing.get("stages", {})
    total_s = sum(stage.get("count", 0) * stage.get("mean", 0.0) for stage in stages.values()) / 1000.0
    rows = []
    for name, stage in stages.items():
        spent_s = stage.get("count", 0) * stage.get("mean", 0.0) / 1000.0
        cells = [str(stage.get("count", "-"))] + [
            f"{stage[column]:.2f}" if column in stage else "-" for column in STAGE_COLUMNS[1:]
        ]
        rows.append(
            [name] + cells + [f"{spent_s:.1f}", f"{100 * spent_s / total_s:.0f} %" if total_s else "-"]
        )
    header = ["stage [ms]"] + list(STAGE_COLUMNS) + ["sum [s]", "share"]
    body = html_page.table(header, rows) if rows else html_page.missing("timing.json names no stages.")
    labels = {
        "bag_s": "data [s]",
        "wall_s": "wall clock [s]",
        "cpu_s": "CPU [s]",
        "peak_memory_mb": "peak memory [MB]",
    }
    known = [[label, f"{timing[key]:.1f}"] for key, label in labels.items() if timing.get(key) is not None]
    return body + (html_page.table(["whole run", ""], known) if known else "")


def parameters(file: Path) -> str:
    """run.yaml, folded away."""
    if not file.is_file():
        return html_page.missing("run.yaml was not found.")
    content = html_page.text(file.read_text(encoding="utf-8", errors="replace"))
    summary_line = f"<summary>{html_page.text(file.name)}: every parameter as used</summary>"
    return f"<details>{summary_line}<pre>{content}</pre></details>\n"
