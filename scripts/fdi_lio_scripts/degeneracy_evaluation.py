"""Whether FDI, class and weak directions are right: rank correlation, right classes, flickers, directions named."""

import warnings
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Dict, List, Optional, Sequence

import numpy as np

from .degeneracy_csv import Degeneracy, read_degeneracy
from .degeneracy_truth import (
    CLASSES, drifts_m, no_registration_errors, read_recording, read_registration_errors, true_classes
)
from .errors import UserError
from .trajectory_io import read_trajectory
from .weak_directions import WeakDirections, judge_directions, read_weak_translations

SUB_FACTORS = ("structural", "sparse", "dynamic")
PARTS = (*SUB_FACTORS, "position_sigma")  # what the FDI is made of
FEWEST_SCANS = 3  # of a rank correlation


@dataclass(frozen=True)
class JudgedRun:
    """Scans of one run with what is true of them. `true_class` is empty for a real recording, the registration
    errors are NaN where nobody measured them."""

    name: str
    table: Degeneracy
    registration_m: np.ndarray
    drift_m: np.ndarray
    true_class: List[str]
    directions: WeakDirections


def ranks(values: np.ndarray) -> np.ndarray:
    """Ranks from 0; equal values share the mean of their ranks."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    ends = np.cumsum(counts)
    return (ends - 0.5 * (counts + 1))[inverse]


def spearman(a: np.ndarray, b: np.ndarray) -> float:
    """Spearman's rank correlation over the pairs in which both are finite; NaN if one is constant."""
    both = np.isfinite(a) & np.isfinite(b)
    if np.count_nonzero(both) < FEWEST_SCANS:
        return float("nan")
    x, y = ranks(a[both]), ranks(b[both])
    x, y = x - x.mean(), y - y.mean()
    scale = np.sqrt((x @ x) * (y @ y))
    return float(x @ y / scale) if scale > 0 else float("nan")


def class_changes(classes: Sequence[str]) -> int:
    """How often the class differs from that of the scan before."""
    return sum(1 for before, now in zip(classes, classes[1:]) if before != now)


def flickers(classes: Sequence[str], true_class: Sequence[str]) -> int:
    """Changes of the class beyond those that the surroundings made."""
    return max(0, class_changes(classes) - class_changes(true_class))


def judge_run(run: Path, truth_folder: Optional[Path]) -> JudgedRun:
    """Reads a folder of offline_slam and the truth of its recording."""
    table = read_degeneracy(str(run / "degeneracy.csv"))
    odometry = read_trajectory(str(run / "odometry.tum"))
    stem = truth_stem(run, truth_folder)
    truth = read_trajectory(f"{stem}.tum")
    if len(odometry) != len(table.stamps) or np.abs(odometry.stamps - table.stamps).max() > 1e-3:
        raise UserError(f"{run}: degeneracy.csv and odometry.tum are of different runs: run offline_slam again")
    if odometry.stamps[-1] < truth.stamps[0] or odometry.stamps[0] > truth.stamps[-1]:
        raise UserError(f"{run}: shares no time with {stem}.tum: is it the truth of this recording?")
    recording = read_recording(stem)
    classes: List[str] = []
    if recording is not None:
        if "points" not in table.others:
            raise UserError(f"{run}/degeneracy.csv: has no column 'points': run offline_slam again")
        classes = true_classes(recording, truth, table.stamps, table.others["points"])
    errors = Path(f"{stem}.registration.csv")
    count = len(table.stamps)
    if errors.is_file():
        registration = read_registration_errors(errors, table.stamps)
        translations = read_weak_translations(run / "directions.csv", count)
    else:
        registration, translations = no_registration_errors(count), np.full((count, 6, 3), np.nan)
    directions = judge_directions(translations, registration)
    return JudgedRun(run.name, table, registration.error_m, drifts_m(odometry, truth), classes, directions)


def truth_stem(run: Path, truth_folder: Optional[Path]) -> Path:
    """STEM of STEM.tum: the longest with which the run's name begins, so that `street_1_full` finds `street_1`."""
    folder = truth_folder if truth_folder is not None else run.parent
    stems = [file.with_suffix("") for file in folder.glob("*.tum") if run.name.startswith(file.stem)]
    if not stems:
        raise UserError(
            f"{run}: {folder} holds no truth of it: expected {folder / run.name}.tum, or another name with which "
            f"'{run.name}' begins (--truth DIR names the folder)"
        )
    return max(stems, key=lambda stem: len(stem.name))


def figures(run: JudgedRun) -> Dict[str, object]:
    """The figures of one run, or of several put together."""
    row: Dict[str, object] = {
        "run": run.name,
        "scans": len(run.table.stamps),
        "fdi": _median(run.table.fdi),
    }
    for name, error_m in (("registration", run.registration_m), ("drift", run.drift_m)):
        row[f"{name}_m"] = _median(error_m)
        row[f"spearman_{name}"] = spearman(run.table.fdi, error_m)
        for part in PARTS:
            if part in run.table.others:
                row[f"spearman_{name}_{part}"] = spearman(run.table.others[part], error_m)
    directions = run.directions
    row["open_scans"] = int(directions.is_open.sum())
    row["closed_scans"] = int(directions.is_closed.sum())
    row["named"] = _share(directions.is_named, directions.is_open)
    row["false_alarms"] = _share(directions.is_alarmed, directions.is_closed)
    if run.true_class:
        right = [a == b for a, b in zip(run.table.classes, run.true_class)]
        row["right"] = float(np.mean(right))
        row["flickers_per_100"] = 100.0 * flickers(run.table.classes, run.true_class) / len(right)
        row["true_class"] = _shares(run.true_class)
        row["class"] = _shares(run.table.classes)
    return row


def _share(part: np.ndarray, whole: np.ndarray) -> float:
    """NaN of nothing."""
    return float(part.sum() / whole.sum()) if whole.any() else float("nan")


def _median(values: np.ndarray) -> float:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # all NaN: a run too short
        return float(np.nanmedian(values))


def _shares(classes: Sequence[str]) -> str:
    """`structured 80 %, sparse 20 %`, the largest first."""
    counts = sorted(((list(classes).count(name), name) for name in CLASSES), reverse=True)
    return ", ".join(f"{name} {100 * count / len(classes):.0f} %" for count, name in counts if count)


def summary(runs: Sequence[JudgedRun]) -> Dict[str, object]:
    """All scans of all runs together. Flickers are summed over the runs, not over their borders."""
    joined = JudgedRun(
        "all",
        Degeneracy(
            np.concatenate([run.table.stamps for run in runs]),
            np.concatenate([run.table.fdi for run in runs]),
            [],
            {
                name: np.concatenate([run.table.others[name] for run in runs])
                for name in PARTS if all(name in run.table.others for run in runs)
            },
        ),
        np.concatenate([run.registration_m for run in runs]),
        np.concatenate([run.drift_m for run in runs]),
        [],
        WeakDirections(
            *(np.concatenate([getattr(run.directions, field.name) for run in runs]) for field in fields(WeakDirections))
        ),
    )
    row = figures(joined)
    judged = [run for run in runs if run.true_class]
    if judged:
        classes = [name for run in judged for name in run.table.classes]
        truths = [name for run in judged for name in run.true_class]
        count = sum(flickers(run.table.classes, run.true_class) for run in judged)
        row["right"] = float(np.mean([a == b for a, b in zip(classes, truths)]))
        row["flickers_per_100"] = 100.0 * count / len(truths)
        row["right_by_class"] = {
            name: float(np.mean([a == b for a, b in zip(classes, truths) if b == name]))
            for name in CLASSES if name in truths
        }
    return row


def _percent(share: float) -> str:
    return "     " if np.isnan(share) else f"{100 * share:3.0f} %"


def text_table(rows: Sequence[Dict[str, object]]) -> str:
    """One line a run, the last one over all."""
    width = max(len(str(row["run"])) for row in rows)
    lines = [
        f"{'run':{width}}  scans   FDI  registration [mm]  Spearman  drift [mm]  Spearman  right  flickers/100  "
        "true class -> class"
    ]
    for row in rows:
        right = f"{100 * row['right']:4.0f} %  {row['flickers_per_100']:12.2f}" if "right" in row else ""
        classes = f"  {row['true_class']} -> {row['class']}" if "true_class" in row else ""
        lines.append(
            f"{row['run']:{width}}  {row['scans']:5d}  {row['fdi']:.2f}  {1e3 * row['registration_m']:17.1f}  "
            f"{row['spearman_registration']:8.2f}  {1e3 * row['drift_m']:10.1f}  {row['spearman_drift']:8.2f}  "
            f"{right}{classes}"
        )
    whole = rows[-1]
    for part in PARTS:
        if f"spearman_drift_{part}" in whole:
            lines.append(
                f"Spearman of {part}, all scans: {whole[f'spearman_registration_{part}']:.2f} with the registration "
                f"error, {whole[f'spearman_drift_{part}']:.2f} with the drift"
            )
    for name, share in dict(whole.get("right_by_class", {})).items():
        lines.append(f"right where {name} is true: {100 * share:.0f} %")
    return "\n".join(lines + _direction_lines(rows, width)) + "\n"


def _direction_lines(rows: Sequence[Dict[str, object]], width: int) -> List[str]:
    """Of the runs whose registration errors were measured."""
    lines = [f"{'weak directions':{width}}  open scans  named  closed scans  false alarms"]
    for row in rows:
        if row["open_scans"] or row["closed_scans"]:
            lines.append(
                f"{row['run']:{width}}  {row['open_scans']:10d}  {_percent(row['named'])}  "
                f"{row['closed_scans']:12d}  {_percent(row['false_alarms'])}"
            )
    return lines if len(lines) > 1 else []
