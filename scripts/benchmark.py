#!/usr/bin/python3
"""Measures the system on simulated recordings: scenarios x seeds x configurations.

Each cell is simulated, run with offline_slam, and compared with the truth as evaluate_trajectory.py does. Finished
cells are kept in OUTPUT/cells and not run again; Ctrl-C loses the running ones only. What the columns mean is in
docs/benchmarks.md. Exit code 0: every cell has a result; 1: some failed; 2: bad input.
"""

import argparse
import datetime
import os
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence

from fdi_lio_scripts import benchmark_cells as cells
from fdi_lio_scripts import benchmark_tables as tables
from fdi_lio_scripts import errors
from fdi_lio_scripts.alignment import MODES
from fdi_lio_scripts.benchmark_run import Benchmark, Plan
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.evaluation import Settings
from fdi_lio_scripts.progress import Progress

REPOSITORY = Path(__file__).resolve().parents[1]
SCENARIOS = REPOSITORY / "config" / "scenarios"
DOCS = REPOSITORY / "docs" / "benchmarks.md"
SOURCES = ("CMakeLists.txt", "cmake", "config", "include", "msg", "src", "srv")  # what decides about results
DEFAULT_SEEDS = "11-13"
SHORT_SCENARIOS = ("street", "tunnel", "corridor", "plaza")
SHORT_SEEDS = "11"
SHORT_DURATION_S = 20.0
EXIT_CELLS_FAILED = 1


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    what = parser.add_argument_group("what is run")
    what.add_argument("--scenarios", nargs="+", metavar="NAME", help="of the folder; all by default")
    what.add_argument(
        "--scenario-folder", type=Path, default=SCENARIOS, metavar="DIR",
        help="where they are (default config/scenarios)"
    )
    what.add_argument("--seeds", metavar="LIST", help=f"such as 11-13 or 11,14,20-22 (default {DEFAULT_SEEDS})")
    what.add_argument("--duration", type=float, metavar="S", help="instead of each scenario's own [s]")
    what.add_argument(
        "--config", action="append", default=[], metavar="NAME='key=value ...'",
        help="a further configuration, compared with `full`, which has no overrides; may be repeated"
    )
    what.add_argument(
        "--compare", action="append", default=[], metavar="NAME=DIR",
        help="another program's trajectories DIR/SCENARIO_SEED.tum; may be repeated"
    )
    what.add_argument(
        "--short", action="store_true",
        help=f"{SHORT_DURATION_S:g} s of {' '.join(SHORT_SCENARIOS)}, seed {SHORT_SEEDS}: a check of minutes"
    )
    what.add_argument("--align", choices=MODES, default="se3", help="how estimates are moved onto the truth")
    how = parser.add_argument_group("how")
    how.add_argument("--output", type=Path, required=True, metavar="DIR", help="results; also what is resumed")
    how.add_argument("--bin", type=Path, metavar="DIR", help="folder of simulate_bag and offline_slam")
    how.add_argument("--jobs", type=int, default=1, metavar="N", help="recordings at a time; times suffer")
    how.add_argument("--keep-bags", action="store_true", help="keep OUTPUT/bags (0.6 to 4 GB each)")
    how.add_argument("--fresh", action="store_true", help="run finished cells again")
    how.add_argument("--timeout", type=float, default=3600.0, metavar="S", help="of one program [s]")
    how.add_argument(
        "--update-docs", nargs="?", type=Path, const=DOCS, metavar="FILE",
        help="replace the benchmark block of FILE (docs/benchmarks.md)"
    )
    arguments = parser.parse_args()
    if arguments.short:
        if arguments.scenarios or arguments.seeds or arguments.duration:
            parser.error("--short has its own scenarios, seeds and duration: leave these options out")
        arguments.scenarios, arguments.seeds = list(SHORT_SCENARIOS), SHORT_SEEDS
        arguments.duration = SHORT_DURATION_S
    if arguments.duration is not None and not 1.0 <= arguments.duration <= 1e5:
        parser.error("--duration must be 1 to 100000 s")
    if arguments.jobs < 1:
        parser.error("--jobs must be at least 1")
    if not arguments.timeout > 0:
        parser.error("--timeout must be positive")
    return arguments


def find_binaries(folder: Optional[Path]) -> Path:
    """The folder with both programs: the one given, or that of the usual build."""
    build = Path(os.environ.get("FDI_LIO_BUILD_DIR", REPOSITORY / "build"))
    found = folder or build / "devel" / "lib" / "fdi_lio"
    missing = [name for name in ("simulate_bag", "offline_slam") if not os.access(found / name, os.X_OK)]
    if missing:
        raise UserError(
            f"{found}: {' and '.join(missing)} not found there: build with scripts/build.sh, or give the folder "
            "with --bin"
        )
    return found.resolve()


def git_version() -> str:
    """`git describe` of the checkout; -dirty if anything that decides about results is changed."""

    def git(*command: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(REPOSITORY), *command], capture_output=True, text=True, check=False
        )
        return done.stdout.strip() if done.returncode == 0 else ""

    try:
        version = git("describe", "--always", "--tags")
        changed = git("status", "--porcelain", "--", *SOURCES)
    except FileNotFoundError:
        return "unknown"
    return (version + ("-dirty" if changed else "")) if version else "unknown"


def check_output(folder: Path) -> None:
    """Makes the folder and writes into it once, before hours are spent."""
    probe = folder / ".writable"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.write_text("", encoding="utf-8")
        probe.unlink()
    except OSError as error:
        reason = f"cannot be written ({error.strerror}): choose another folder"
        raise UserError(f"--output {folder}: {reason}") from None


def update_docs(file: Path, records: Sequence[cells.Record], about: Dict[str, Any], output: Path) -> None:
    """The block with tables and copies of the plots."""
    images = file.parent / "images"
    images.mkdir(exist_ok=True)
    for name in ("ate", "speed"):
        shutil.copyfile(output / f"{name}.png", images / f"benchmark_{name}.png")
    tables.replace_block(file, tables.report(records, about, "images/benchmark_", whole=False))
    print(f"updated {file} and {images}/benchmark_*.png")


def write_results(records: Sequence[cells.Record], about: Dict[str, Any], output: Path) -> None:
    """results.json, results.md and the plots."""
    # matplotlib takes a second to load, which --help and bad input do not need
    from fdi_lio_scripts.benchmark_plots import write_plots  # pylint: disable=import-outside-toplevel

    cells.write_json(output / "results.json", {**about, "cells": list(records)})
    title = "# Benchmark of fdi_lio on simulated recordings\n\n"
    text = title + tables.report(records, about, "", whole=True)
    (output / "results.md").write_text(text, encoding="utf-8")
    write_plots(records, output)
    print(tables.summary_table(records))
    print("\n".join(filter(None, (tables.ratio_table(records), tables.failure_table(records)))))
    print(f"wrote {output}/results.md, results.json, ate.png, speed.png")


def run_all(benchmark: Benchmark) -> List[cells.Record]:
    """Runs what is missing, with a progress bar over the cells."""
    to_do = benchmark.total - benchmark.finished
    if benchmark.finished:
        print(f"{benchmark.finished} of {benchmark.total} cells are finished (--fresh runs them again)")
    with Progress(to_do, "cells") as progress:
        benchmark.run(progress.step)
    return benchmark.records()


def interrupted(*_: object) -> None:
    """A request to end is treated as Ctrl-C, so that the programs end too."""
    raise KeyboardInterrupt


def main() -> int:
    """Checks everything that can be checked, runs, reports."""
    arguments = parse_arguments()
    signal.signal(signal.SIGTERM, interrupted)
    seeds = cells.parse_seeds(arguments.seeds or DEFAULT_SEEDS)
    scenarios = cells.chosen_scenarios(arguments.scenarios, arguments.scenario_folder)
    places = [cells.Place(scenario, seed, arguments.duration) for scenario in scenarios for seed in seeds]
    configurations = cells.parse_configurations(arguments.config)
    plan = Plan(
        binaries=find_binaries(arguments.bin),
        scenarios=arguments.scenario_folder,
        output=arguments.output,
        configurations=configurations,
        version=git_version(),
        evaluation=Settings(interpolate=True, align=arguments.align),
        comparisons=cells.parse_comparisons(arguments.compare, configurations, places),
        jobs=arguments.jobs,
        keep_bags=arguments.keep_bags,
        fresh=arguments.fresh,
        timeout_s=arguments.timeout,
    )
    if arguments.update_docs:
        tables.check_block(arguments.update_docs)
    check_output(arguments.output)
    records = run_all(Benchmark(plan, places))
    about = {
        "date": datetime.date.today().isoformat(),
        "version": plan.version,
        "machine": tables.machine(),
        "command": shlex.join(["scripts/benchmark.py", *sys.argv[1:]]),
        "align": arguments.align,
        "overrides": {configuration.name: list(configuration.overrides) for configuration in configurations},
    }
    write_results(records, about, arguments.output)
    if arguments.update_docs:
        update_docs(arguments.update_docs, records, about, arguments.output)
    return 0 if all(record["ok"] for record in records) else EXIT_CELLS_FAILED


if __name__ == "__main__":
    errors.run(main)
