"""The tables of a benchmark in Markdown, and their place in docs/benchmarks.md."""

import os
import platform
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence

from .benchmark_cells import LAST_TUNING_SEED, Record
from .benchmark_statistics import ALL, Ratio, for_each, ratios, relative_key, spread, stage_medians, unique
from .errors import UserError

BLOCK_BEGIN, BLOCK_END = "<!-- benchmark:begin -->", "<!-- benchmark:end -->"
ERROR_LENGTH = 160  # characters of a message in a table


def machine() -> str:
    """Processor, cores and memory, as far as the system tells."""
    name, memory = platform.machine(), ""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        name = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), name)
        kilobytes = Path("/proc/meminfo").read_text(encoding="utf-8").split()[1]
        memory = f", {int(kilobytes) / 1e6:.0f} GB"
    except (OSError, ValueError, IndexError):
        pass
    return f"{name}, {os.cpu_count()} cores{memory}"


def table(header: Sequence[str], rows: Sequence[Sequence[str]], text_columns: int) -> str:
    """A Markdown table; columns after the first `text_columns` are aligned to the right."""
    lines = ["| " + " | ".join(header) + " |"]
    lines.append("|" + "---|" * text_columns + "---:|" * (len(header) - text_columns))
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def figure(value: Optional[float], digits: int) -> str:
    """A number, or a dash where there is none."""
    return "-" if value is None else f"{value:.{digits}f}"


def median(cells: Sequence[Record], key: str, digits: int, factor: float = 1.0) -> str:
    """Median over the seeds."""
    found = spread(cells, key)
    return figure(found.median * factor if found else None, digits)


def median_and_range(cells: Sequence[Record], key: str) -> str:
    """Median and, with several seeds, the range."""
    found = spread(cells, key)
    if not found:
        return "-"
    text = f"{found.median:.3f}"
    return text if found.count == 1 else f"{text} ({found.low:.3f}-{found.high:.3f})"


def summary_table(records: Sequence[Record]) -> str:
    """One row for each scenario and configuration."""

    def row(scenario: str, configuration: str, cells: List[Record]) -> List[str]:
        key = relative_key(records, scenario)
        covered, largest = spread(cells, "covered_share"), spread(cells, "ate_max_m")
        relative = median(cells, key, 2)
        if relative != "-" and key == "relative_percent_short":
            relative += " *"
        return [
            scenario,
            configuration,
            f"{sum(bool(cell['ok']) for cell in cells)}/{len(cells)}",
            median(cells, "path_m", 0),
            median_and_range(cells, "ate_rmse_m"),
            figure(largest.high if largest else None, 3),
            relative,
            figure(100 * covered.low if covered else None, 1),
            median(cells, "final_error_m", 3),
            median(cells, "real_time_factor", 1),
            median(cells, "cpu_s_per_s", 2),
            median(cells, "peak_memory_mb", 0),
        ]

    header = (
        "scenario", "configuration", "runs", "path [m]", "ATE rmse [m]", "ATE max [m]", "relative [%]",
        "covered [%]", "final [m]", "x real time", "CPU s/s", "memory [MB]"
    )
    rows = for_each(records, row)
    text = table(header, rows, 2)
    if any(row[6].endswith("*") for row in rows):
        text += "\n\\* over 10, 20 and 50 m, since a path of this scenario is too short for 100 to 800 m.\n"
    return text


def ratio_table(records: Sequence[Record]) -> str:
    """ATE of each further column relative to the first; empty with a single column."""
    found = ratios(records)
    if not found:
        return ""
    first = unique(records, "configuration")[0]
    rows = [_ratio_row(ratio) for ratio in found]
    header = ("configuration", "scenario", "cells", "left out", f"ATE / ATE of {first}", "95 % interval")
    return table(header, rows, 2)


def _ratio_row(ratio: Ratio) -> List[str]:
    interval = "-" if ratio.low is None else f"{ratio.low:.3f}-{ratio.high:.3f}"
    scenario = "**all**" if ratio.scenario == ALL else ratio.scenario
    cells = [str(ratio.cells), str(ratio.left_out)]
    return [ratio.configuration, scenario, *cells, figure(ratio.ratio, 3), interval]


def stage_table(records: Sequence[Record]) -> str:
    """Median time of each stage in ms; empty if no run wrote times."""
    stages = list(dict.fromkeys(name for record in records for name in record.get("stages_ms", {})))
    if not stages:
        return ""

    def row(scenario: str, configuration: str, cells: List[Record]) -> List[str]:
        times = stage_medians(cells)
        return [scenario, configuration] + [figure(times.get(stage), 2) for stage in stages]

    own = [record for record in records if not record.get("compared")]
    return table(("scenario", "configuration", *stages), for_each(own, row), 2)


def failure_table(records: Sequence[Record]) -> str:
    """Every cell without a result; empty if there is none."""
    failed = [record for record in records if not record["ok"]]
    rows = []
    for record in failed:
        code = "-" if record.get("exit_code") is None else str(record["exit_code"])
        message = record["error"].replace("|", "\\|").replace("\n", " ")
        message = message if len(message) <= ERROR_LENGTH else message[:ERROR_LENGTH] + "..."
        rows.append([
            record["scenario"], str(record["seed"]), record["configuration"], record["failed_at"], code, message
        ])
    return table(("scenario", "seed", "configuration", "stage", "exit code", "message"), rows, 6) if rows else ""


def cell_table(records: Sequence[Record]) -> str:
    """One row for each cell."""
    rows = [[
        record["scenario"], str(record["seed"]), record["configuration"],
        *(median([record], key, digits) for key, digits in (
            ("path_m", 1), ("ate_rmse_m", 4), ("ate_max_m", 4), ("relative_percent_long", 3),
            ("relative_percent_short", 3)
        )),
        median([record], "covered_share", 1, 100.0), median([record], "final_error_m", 4),
        median([record], "real_time_factor", 1)
    ] for record in records]
    header = (
        "scenario", "seed", "configuration", "path [m]", "ATE rmse [m]", "ATE max [m]", "100-800 m [%]",
        "10-50 m [%]", "covered [%]", "final [m]", "x real time"
    )
    return table(header, rows, 3)


def remarks(records: Sequence[Record], about: Dict[str, Any]) -> str:
    """Where the figures come from, and what a reader must know about them."""
    seeds = unique(records, "seed")
    lines = [
        f"- {about['date']}, version `{about['version']}`, {about['machine']}",
        f"- `{about['command']}`",
        f"- seeds {', '.join(map(str, seeds))}; {duration_text(records)}; alignment {about['align']}",
    ]
    lines += [f"- `{name}`: {' '.join(overrides)}" for name, overrides in about["overrides"].items() if overrides]
    others = [version for version in unique([{"version": None, **r} for r in records], "version")
              if version not in (None, about["version"])]
    if others:
        lines.append(f"- Some cells were kept from version {', '.join(others)}, with equal programs and scenarios.")
    tuning = [seed for seed in seeds if seed <= LAST_TUNING_SEED]
    if tuning:
        lines.append(f"- **Not for reporting: seeds up to {LAST_TUNING_SEED} were used for tuning.**")
    if any(record.get("jobs", 1) > 1 for record in records):
        lines.append("- Several cells ran at the same time (`--jobs`), so times are longer than alone.")
    return "\n".join(lines) + "\n"


def duration_text(records: Sequence[Record]) -> str:
    """How long the recordings are."""
    duration_s = records[0]["duration_s"]
    return f"{duration_s:g} s of each scenario" if duration_s else "whole scenarios"


def report(records: Sequence[Record], about: Dict[str, Any], pictures: str, whole: bool) -> str:
    """All tables; `pictures` is put before the names of the plots. `whole` adds stages and single cells."""
    parts = [remarks(records, about), summary_table(records)]
    parts.append(f"![absolute trajectory error]({pictures}ate.png)\n\n![speed]({pictures}speed.png)\n")
    for title, text in (
        ("Ratios", ratio_table(records)), ("Failed cells", failure_table(records)),
        ("Stages, median time of a scan [ms]", stage_table(records) if whole else ""),
        ("Cells", cell_table(records) if whole else "")
    ):
        if text:
            parts.append(f"### {title}\n\n{text}")
    return "\n".join(parts)


def check_block(file: Path) -> None:
    """Refuses a file without the two markers, before hours are spent."""
    text = file.read_text(encoding="utf-8") if file.is_file() else ""
    if text.count(BLOCK_BEGIN) != 1 or text.count(BLOCK_END) != 1 or (
        text.index(BLOCK_BEGIN) > text.index(BLOCK_END)
    ):
        raise UserError(f"{file}: must hold the lines {BLOCK_BEGIN} and {BLOCK_END}, each once, in this order")


def replace_block(file: Path, content: str) -> None:
    """Replaces what stands between the markers; everything else stays as it is."""
    check_block(file)
    text = file.read_text(encoding="utf-8")
    before, rest = text.split(BLOCK_BEGIN)
    after = rest.split(BLOCK_END)[1]
    file.write_text(f"{before}{BLOCK_BEGIN}\n{content}{BLOCK_END}{after}", encoding="utf-8")
