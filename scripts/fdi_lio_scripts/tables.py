"""Tables of evaluation results as text, Markdown and CSV."""

import csv
import io
from pathlib import Path
from typing import Any, Dict, List, Sequence, Tuple

from .evaluation import Evaluation
from .metrics import STATISTICS

Row = Tuple[str, List[str]]  # label, one cell for each ground truth


def result_rows(evaluations: Sequence[Evaluation]) -> List[Row]:
    """All rows of the table. A dash stands where a figure does not exist."""
    summaries = [evaluation.summary() for evaluation in evaluations]
    rows: List[Row] = [
        ("matched poses", [str(s["matched_poses"]) for s in summaries]),
        ("truth covered [%]", [f"{100 * s['truth_covered_share']:.1f}" for s in summaries]),
        ("longest gap [s]", [f"{s['longest_gap_s']:.3f}" for s in summaries]),
        ("truth path, matched [m]", [f"{s['matched_truth_path_m']:.2f}" for s in summaries]),
        ("estimate path, matched [m]", [f"{s['matched_estimate_path_m']:.2f}" for s in summaries]),
    ]
    if any(s["settings"]["align"] == "sim3" for s in summaries):
        rows.append(("scale", [f"{s['alignment']['scale']:.6f}" for s in summaries]))
    for key, label in (("ate_m", "ATE {} [m]"), ("rotation_deg", "rotation {} [deg]")):
        rows += [(_label(label, name), [_figure(s[key], name) for s in summaries]) for name in STATISTICS]
    for key, label in (("rpe_translation_m", "RPE {} [m]"), ("rpe_rotation_deg", "RPE {} [deg]")):
        rows += [
            (label.format(name), [_figure(s[key], name) for s in summaries]) for name in (
                "rmse", "mean", "max"
            )
        ]
    for key, label in (("kitti_segments", "KITTI"), ("short_segments", "short segments")):
        rows += _segment_rows(label, [s[key] for s in summaries])
    return rows


def _label(template: str, name: str) -> str:
    """Sums of squares have squared units."""
    label = template.format(name)
    return label.replace("[m]", "[m^2]").replace("[deg]", "[deg^2]") if name == "sse" else label


def _figure(values: Any, name: str) -> str:
    return "-" if values is None else f"{values[name]:.6f}"


def _segment_rows(label: str, columns: Sequence[List[Dict[str, Any]]]) -> List[Row]:
    """Rows of the relative errors: the lengths that any column has, then their mean."""
    lengths = sorted(
        {row["length_m"] for column in columns for row in column}, key=lambda length: length or 1e9
    )
    rows: List[Row] = []
    for length in lengths:
        name = f"{length:.0f} m" if length else "mean"
        found = [next((row for row in column if row["length_m"] == length), None) for column in columns]
        rows.append((f"{label} {name} [%]", [_segment(row, "translation_percent") for row in found]))
        rows.append((f"{label} {name} [deg/100m]", [_segment(row, "rotation_deg_per_100m") for row in found]))
    return rows


def _segment(row: Any, key: str) -> str:
    return "-" if row is None else f"{row[key]:.4f}"


def notes(evaluations: Sequence[Evaluation]) -> List[str]:
    """What a reader must know to read the figures right."""
    settings = evaluations[0].settings
    pairing = "truth interpolated at the estimate's stamps" if settings.interpolate else (
        f"nearest stamps within {settings.max_diff_s} s"
    )
    lines = [f"pairs: {pairing}; alignment: {settings.align}; RPE over {settings.rpe_delta} pose(s)"]
    for evaluation in evaluations:
        name = evaluation.truth.name
        if evaluation.pairs.reused:
            lines.append(
                f"{name}: {evaluation.pairs.reused} poses were nearest to more than one (--once prevents it)"
            )
        if evaluation.kitti and evaluation.short_segments:
            lines.append(
                f"{name}: the path is shorter than 800 m: segments of 10, 20, 50 m are given beside KITTI's"
            )
        elif evaluation.short_segments:
            lines.append(
                f"{name}: the path is too short for KITTI's segments (100 m and more): 10, 20, 50 m instead"
            )
        elif not evaluation.kitti:
            lines.append(f"{name}: the path is too short for relative errors over segments")
    return lines


def text_table(evaluations: Sequence[Evaluation]) -> str:
    """The table for a terminal."""
    names = [Path(evaluation.truth.name).name for evaluation in evaluations]
    rows = result_rows(evaluations)
    width = max(len(label) for label, _ in rows)
    widths = [max(len(name), *(len(cells[i]) for _, cells in rows)) for i, name in enumerate(names)]
    lines = [f"estimate: {evaluations[0].pairs.estimate.name}"]
    lines += notes(evaluations)
    for label, cells in [("", names)] + rows:
        lines.append("  ".join([label.ljust(width)] + [cell.rjust(w) for cell, w in zip(cells, widths)]))
    return "\n".join(lines) + "\n"


def markdown_table(evaluations: Sequence[Evaluation]) -> str:
    """The table as Markdown."""
    names = [Path(evaluation.truth.name).name for evaluation in evaluations]
    lines = ["| " + " | ".join([Path(evaluations[0].pairs.estimate.name).name] + names) + " |"]
    lines.append("|" + "---|" + "---:|" * len(names))
    lines += ["| " + " | ".join([label] + cells) + " |" for label, cells in result_rows(evaluations)]
    return "\n".join(lines) + "\n\n" + "\n".join(f"- {note}" for note in notes(evaluations)) + "\n"


def csv_table(evaluations: Sequence[Evaluation]) -> str:
    """One line for each ground truth, with the labels of the text table as header."""
    rows = result_rows(evaluations)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["estimate", "ground truth"] + [label for label, _ in rows])
    for index, evaluation in enumerate(evaluations):
        cells = [row[index] if row[index] != "-" else "" for _, row in rows]
        writer.writerow([evaluation.pairs.estimate.name, evaluation.truth.name] + cells)
    return stream.getvalue()
