"""Pictures of a benchmark: bars by scenario, one colour for each configuration, a dot for each seed."""

from pathlib import Path
from typing import List, Sequence

import numpy as np

from . import plots
from .benchmark_cells import Record
from .benchmark_statistics import SMALLEST_ATE_M, select, unique, values

COLOURS = ("#1f5fa8", "#e08a1e", "#4c9a52", "#8e5ea2", "#c0392b", "#5a6472", "#17a2b8", "#b59b1e")
GROUP_WIDTH = 0.8  # of the distance between two scenarios


def write_plots(records: Sequence[Record], folder: Path) -> List[Path]:
    """Writes ate.png and speed.png."""
    written = [folder / "ate.png", folder / "speed.png"]
    plots.save(ate_figure(records), str(written[0]))
    plots.save(speed_figure(records), str(written[1]))
    return written


def ate_figure(records: Sequence[Record]) -> plots.Figure:
    """ATE rmse on a logarithmic scale; a cross on the lower edge is a cell without a result."""
    figure, axes = _figure(records)
    found = [max(value, SMALLEST_ATE_M) for value in values(records, "ate_rmse_m")]
    low, high = (min(found), max(found)) if found else (0.01, 1.0)
    axes.set_yscale("log")
    # At least a decade, so that there is a labelled tick.
    axes.set_ylim(low / 2, max(high * 2, low * 10))
    _bars(axes, records, "ate_rmse_m", low / 2)
    axes.set_ylabel("ATE rmse [m]")
    return figure


def speed_figure(records: Sequence[Record]) -> plots.Figure:
    """Seconds of recording for each second of computing, of the cells that this program ran."""
    own = [record for record in records if not record.get("compared")]
    figure, axes = _figure(own)
    _bars(axes, own, "real_time_factor", 0.0)
    axes.axhline(1.0, color="k", lw=1, ls="--")
    axes.annotate(
        "real time", (0.995, 1.0), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=9
    )
    axes.set_ylim(0, 1.1 * max(values(own, "real_time_factor") + [1.5]))
    axes.set_ylabel("times real time")
    return figure


def _figure(records: Sequence[Record]) -> tuple:
    scenarios = unique(records, "scenario")
    bars = len(scenarios) * len(unique(records, "configuration"))
    figure, axes = plots.new_figure(float(np.clip(2.5 + 0.3 * bars + 0.35 * len(scenarios), 6, 18)), 4.6)
    turned = len(scenarios) > 6
    axes.set_xticks(range(len(scenarios)))
    axes.set_xticklabels(scenarios, rotation=35 if turned else 0, ha="right" if turned else "center")
    axes.set_xlim(-0.6, max(len(scenarios), 1) - 0.4)
    axes.grid(False, axis="x")
    return figure, axes


def _bars(axes: plots.Axes, records: Sequence[Record], key: str, bottom: float) -> None:
    """Bars of medians, dots of single cells, and a legend above."""
    configurations = unique(records, "configuration")
    width = GROUP_WIDTH / max(len(configurations), 1)
    handles = []
    for index, configuration in enumerate(configurations):
        colour = COLOURS[index % len(COLOURS)]
        handles.append(plots.plt.Rectangle((0, 0), 1, 1, color=colour, alpha=0.5))
        for group, scenario in enumerate(unique(records, "scenario")):
            cells = select(records, scenario, configuration)
            place = group + (index - 0.5 * (len(configurations) - 1)) * width
            found = values(cells, key)
            if found:
                height = max(float(np.median(found)) - bottom, 0.0)
                axes.bar(place, height, 0.9 * width, bottom=bottom, color=colour, alpha=0.5, lw=0)
                axes.plot(_spread_out(place, width, len(found)), found, "o", color=colour, ms=4, mec="w", mew=0.5)
            failed = sum(not cell["ok"] for cell in cells)
            if failed:
                axes.plot(
                    _spread_out(place, width, failed), [0.03] * failed, "x", color="k", ms=6, mew=1.5,
                    transform=axes.get_xaxis_transform()
                )
    if any(not record["ok"] for record in records):
        handles.append(plots.plt.Line2D([], [], color="k", marker="x", ls="", label="failed"))
        configurations = configurations + ["failed"]
    axes.legend(handles, configurations, loc="lower left", bbox_to_anchor=(0, 1), ncol=4)


def _spread_out(centre: float, width: float, count: int) -> np.ndarray:
    """Places for `count` marks side by side within a bar."""
    return centre + 0.5 * width * (np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1))
