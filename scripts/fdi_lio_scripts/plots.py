"""Pictures of trajectories, errors and degeneracy. Each function draws on axes that it is given."""

from typing import Dict, List, Optional

import matplotlib

matplotlib.use("Agg")  # no display is needed
import matplotlib.pyplot as plt  # noqa: E402  (after the choice of backend)
import numpy as np  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.collections import LineCollection  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

from .degeneracy_csv import Degeneracy  # noqa: E402
from .trajectory import Trajectory  # noqa: E402

TRUTH_COLOUR = "#b5b5b5"
ESTIMATE_COLOUR = "#1f5fa8"
ERROR_COLOUR = "#c0392b"
# The environment classes of the package; any other name gets the last colour.
CLASS_COLOURS = {"structured": "#8fbf8f", "sparse": "#f2c46d", "dynamic": "#d98880", "mixed": "#a9b7d9"}
OTHER_CLASS_COLOUR = "#cccccc"
LABELS_IN = 0.6  # height of the labels of an axis

plt.rcParams.update({
    "figure.dpi": 110, "font.size": 10, "axes.grid": True, "grid.alpha": 0.3, "axes.axisbelow": True,
    "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
    "figure.constrained_layout.use": True,
})


def new_figure(width_in: float, height_in: float, rows: int = 1, heights: Optional[List[float]] = None):
    """A figure and its axes, one below the other with a common x axis."""
    return plt.subplots(
        rows, 1, figsize=(width_in, height_in), sharex=rows > 1, gridspec_kw={
            "height_ratios": heights or [1] * rows
        }
    )


def fit_height(figure: Figure, width_m: float, height_m: float) -> None:
    """Makes a picture with equal scales as high as what it shows, within what fits a page."""
    share = float(np.clip(height_m / max(width_m, 1e-6), 0.25, 0.8))
    figure.set_figheight(share * figure.get_figwidth() + LABELS_IN)


def save(figure: Figure, path: str) -> None:
    """Writes the picture and frees its memory."""
    figure.savefig(path)
    plt.close(figure)


def path_view(axes: Axes, vertical: int, estimate: Trajectory, truth: Optional[Trajectory]) -> None:
    """The path with x to the right and `vertical` (1: y, top view; 2: z, side view) upwards, in metres.

    The top view has equal scales. In the side view heights are a few metres over a path of hundreds, so there
    the scales differ, which the label says.
    """
    if truth is not None:
        axes.plot(
            truth.positions[:, 0],
            truth.positions[:, vertical],
            color=TRUTH_COLOUR,
            lw=3.5,
            label="ground truth",
        )
    axes.plot(
        estimate.positions[:, 0],
        estimate.positions[:, vertical],
        color=ESTIMATE_COLOUR,
        lw=1.2,
        label="estimate",
    )
    axes.plot(*estimate.positions[0, [0, vertical]], "o", color=ESTIMATE_COLOUR, ms=6, label="start")
    axes.set_xlabel("x [m]")
    if vertical == 1:
        axes.set_ylabel("y [m]")
        axes.set_aspect("equal", adjustable="datalim")
        fit_height(axes.figure, *np.ptp(estimate.positions[:, :2], axis=0))
    else:
        axes.set_ylabel("z [m] (own scale)")
        # Without this a flat path fills the picture with millimetres of noise.
        low, high = axes.get_ylim()
        if high - low < 1.0:
            middle = 0.5 * (low + high)
            axes.set_ylim(middle - 0.5, middle + 0.5)
    axes.legend(loc="best")


def error_on_path(axes: Axes, truth: Trajectory, errors_m: np.ndarray) -> None:
    """The true path seen from above, coloured by the position error."""
    points = truth.positions[:, :2]
    segments = np.stack([points[:-1], points[1:]], axis=1)
    lines = LineCollection(segments, cmap="viridis", linewidths=3, capstyle="round")
    lines.set_array(0.5 * (errors_m[:-1] + errors_m[1:]))
    axes.add_collection(lines)
    axes.autoscale()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    fit_height(axes.figure, *np.ptp(points, axis=0))
    axes.figure.colorbar(lines, ax=axes, label="position error [m]", shrink=0.85)


def error_over_time(axes: Axes, seconds: np.ndarray, errors_m: np.ndarray) -> None:
    """Position error over time, with its rmse."""
    rmse = float(np.sqrt(np.mean(errors_m**2)))
    axes.plot(seconds, errors_m, color=ERROR_COLOUR, lw=1)
    axes.axhline(rmse, color="k", lw=0.8, ls="--", label=f"rmse {rmse:.3f} m")
    axes.set_ylim(0, 1.1 * float(errors_m.max()) or 1.0)
    axes.set_ylabel("position error [m]")
    axes.legend(loc="best")


def rotation_error_over_time(axes: Axes, seconds: np.ndarray, errors_deg: np.ndarray) -> None:
    """Rotation error over time."""
    axes.plot(seconds, errors_deg, color="#8e5ea2", lw=1)
    axes.set_ylim(0, 1.1 * float(errors_deg.max()) or 1.0)
    axes.set_ylabel("rotation error [deg]")


def fdi_over_time(axes: Axes, degeneracy: Degeneracy, start_s: float) -> None:
    """The FDI over time, with the environment class as the colour behind it."""
    seconds = degeneracy.stamps - start_s
    for first, last, name in class_spans(degeneracy.classes):
        end = seconds[min(last + 1, len(seconds) - 1)]
        axes.axvspan(seconds[first], end, color=CLASS_COLOURS.get(name, OTHER_CLASS_COLOUR), alpha=0.55, lw=0)
    axes.plot(seconds, degeneracy.fdi, color="k", lw=1)
    axes.set_ylim(0, 1)
    axes.set_ylabel("FDI")
    handles: Dict[str, object] = {}
    for name in dict.fromkeys(name for name in degeneracy.classes if name):
        handles[name] = plt.Rectangle(
            (0, 0), 1, 1, color=CLASS_COLOURS.get(name, OTHER_CLASS_COLOUR), alpha=0.55
        )
    if handles:
        # above the curve, which may be anywhere between 0 and 1
        axes.legend(
            handles.values(), handles.keys(), loc="lower left", bbox_to_anchor=(0, 1), ncol=len(handles)
        )


def class_spans(classes: List[str]) -> List[tuple]:
    """Runs of equal class names as (first index, last index, name); rows without a name are left out."""
    spans: List[tuple] = []
    for index, name in enumerate(classes):
        if spans and spans[-1][2] == name:
            spans[-1] = (spans[-1][0], index, name)
        else:
            spans.append((index, index, name))
    return [span for span in spans if span[2]]


def colour_map(name: str) -> object:
    """A colour map whose NaN pixels stay clear."""
    colours = matplotlib.colormaps[name].copy()
    colours.set_bad(alpha=0.0)
    return colours


def sub_factors_over_time(axes: Axes, degeneracy: Degeneracy, names: List[str], start_s: float) -> None:
    """Several columns between 0 and 1 in one picture."""
    for name in names:
        axes.plot(degeneracy.stamps - start_s, degeneracy.others[name], lw=1, label=name)
    axes.set_ylim(-0.02, 1.02)
    axes.set_ylabel("sub-factors")
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncol=len(names))


def small_multiples(columns: Dict[str, np.ndarray], seconds: np.ndarray) -> Figure:
    """One small picture for each column over a common time axis, two side by side."""
    rows = -(-len(columns) // 2)
    figure, axes = plt.subplots(rows, 2, figsize=(10.0, 1.5 * rows + 0.4), sharex=True, squeeze=False)
    for axis, (name, values) in zip(axes.flat, columns.items()):
        axis.plot(seconds, values, lw=0.8, color=ESTIMATE_COLOUR)
        axis.set_title(name, fontsize=9, loc="left")
        axis.tick_params(labelsize=8)
    for axis in axes.flat[len(columns):]:
        axis.set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    return figure
