"""Runs the cells of a benchmark: simulates a recording, runs the system on it, and measures the result."""

from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable, Dict, List, Optional, Sequence

import numpy as np

from .benchmark_cells import (
    Configuration, Place, Record, cell_file, compared_file, digest, finished, read_json, scenario_files,
    write_json
)
from .benchmark_programs import Programs, failure
from .errors import UserError
from .evaluation import Settings, evaluate
from .trajectory_io import read_trajectory

LARGE_RESULTS = ("map.pcd", "directions.csv")  # of a run; nobody looks at those of a benchmark


@dataclass(frozen=True)
class Plan:
    """Everything that is the same for all cells of one benchmark."""

    binaries: Path
    scenarios: Path  # folder
    output: Path
    configurations: Sequence[Configuration]
    version: str
    evaluation: Settings
    comparisons: Dict[str, Path] = field(default_factory=dict)
    jobs: int = 1
    keep_bags: bool = False
    fresh: bool = False
    timeout_s: float = 3600.0

    def programs_digest(self) -> str:
        """Hash of the programs and of the package's libraries beside them."""
        libraries = sorted(self.binaries.parent.glob("*fdi_lio*.so"))
        return digest([self.binaries / "simulate_bag", self.binaries / "offline_slam", *libraries])


class Benchmark:
    """The cells of a plan: which exist, and making those that do not."""

    def __init__(self, plan: Plan, places: Sequence[Place]) -> None:
        self._plan = plan
        self._places = places
        self._programs = Programs(plan.timeout_s)
        self._programs_digest = plan.programs_digest()
        self._records: Dict[tuple, Record] = {}
        if not plan.fresh:
            for place in places:
                for configuration in plan.configurations:
                    identity = self._identity(place, configuration)
                    stored = finished(plan.output, place, configuration.name, identity)
                    if stored:
                        self._records[(place, configuration.name)] = stored

    @property
    def total(self) -> int:
        """Cells of this program, finished or not."""
        return len(self._places) * len(self._plan.configurations)

    @property
    def finished(self) -> int:
        """Cells that need not be run."""
        return len(self._records)

    def records(self) -> List[Record]:
        """All results, by scenario, seed and column."""
        names = [configuration.name for configuration in self._plan.configurations]
        names += list(self._plan.comparisons)
        return [self._records[(place, name)] for place in self._places for name in names]

    def run(self, step: Callable[[], None]) -> None:
        """Makes what is missing; `step` is called after each cell of this program.

        On Ctrl-C the running programs are ended and the finished cells stay.
        """
        with ThreadPoolExecutor(self._plan.jobs) as pool:
            futures = [pool.submit(self._run_place, place, step) for place in self._places]
            try:
                for future in as_completed(futures):
                    future.result()
            except BaseException:
                for future in futures:
                    future.cancel()
                self._programs.stop()
                raise

    def _identity(self, place: Place, configuration: Configuration) -> Record:
        """What must be equal for a stored result to be taken.

        The git version is not: what decides is the programs, which read no file of config/ but the scenario (the
        parameters of a recording are written by simulate_bag).
        """
        return {
            "scenario": place.scenario,
            "seed": place.seed,
            "duration_s": place.duration_s,
            "configuration": configuration.name,
            "overrides": list(configuration.overrides),
            "align": self._plan.evaluation.align,
            "programs": self._programs_digest,
            "scenario_digest": digest(scenario_files(self._plan.scenarios, place.scenario)),
        }

    def _run_place(self, place: Place, step: Callable[[], None]) -> None:
        """One recording: all configurations that are missing, then the other programs' trajectories."""
        plan = self._plan
        bag = plan.output / "bags" / f"{place.stem}.bag"
        missing = [c for c in plan.configurations if (place, c.name) not in self._records]
        kept = bag.is_file()  # asked for in an earlier run, so not ours to delete
        try:
            problem = self._simulate(place, bag, with_bag=bool(missing))
            for configuration in missing:
                record = {**self._identity(place, configuration), "version": plan.version, "jobs": plan.jobs}
                record.update(problem or self._run_cell(place, configuration, bag))
                write_json(cell_file(plan.output, place, configuration.name), record)
                self._records[(place, configuration.name)] = record
                step()
        finally:
            if not plan.keep_bags and not kept:
                for suffix in (".bag", ".labels", ".bag.active", ".labels.active"):
                    with_suffix(bag, suffix).unlink(missing_ok=True)
        for name, folder in plan.comparisons.items():
            record = {"scenario": place.scenario, "seed": place.seed, "duration_s": place.duration_s}
            record.update({"configuration": name, "align": plan.evaluation.align, "compared": True})
            file = compared_file(folder, place)
            if problem:
                record.update(problem)
            elif file.is_file():
                record.update(self._measured(file, with_suffix(bag, ".tum")))
            else:
                record.update(failure("comparison", f"{file} does not exist"))
            self._records[(place, name)] = record

    def _simulate(self, place: Place, bag: Path, with_bag: bool) -> Optional[Record]:
        """Makes the recording unless it is there; returns what went wrong, if anything.

        Without a bag only the truth is needed, and only if there are other programs to compare.
        """
        if not with_bag and not self._plan.comparisons:
            return None
        scenario = scenario_files(self._plan.scenarios, place.scenario)
        key = {"programs": self._programs_digest, "scenario": digest(scenario)}
        key_file = with_suffix(bag, ".key.json")
        if read_json(key_file) == key and with_suffix(bag, ".tum").is_file() and (
            bag.is_file() or not with_bag
        ):
            return None
        bag.parent.mkdir(parents=True, exist_ok=True)
        key_file.unlink(missing_ok=True)
        command: List[object] = [self._plan.binaries / "simulate_bag", "--scenario", scenario[0]]
        command += ["--seed", place.seed, "--output", bag]
        if place.duration_s:
            command += ["--duration", f"{place.duration_s:g}"]
        outcome = self._programs.run(command)
        if outcome.exit_code != 0:
            return outcome.failure("simulation")
        write_json(key_file, key)
        return None

    def _run_cell(self, place: Place, configuration: Configuration, bag: Path) -> Record:
        """Runs the system on the recording and measures what it wrote."""
        run = self._plan.output / "runs" / f"{place.stem}_{configuration.name}"
        run.mkdir(parents=True, exist_ok=True)
        for name in ("trajectory.tum", "timing.json"):
            (run / name).unlink(missing_ok=True)  # of an earlier run, which must not be taken for this one's
        command: List[object] = [
            self._plan.binaries / "offline_slam", "--config", with_suffix(bag, ".config.yaml"), "--bag", bag,
            "--output", run
        ]
        for override in configuration.overrides:
            command += ["--set", override]
        outcome = self._programs.run(command)
        if self._plan.programs_digest() != self._programs_digest:
            raise UserError(
                f"{self._plan.binaries}: the programs changed while the benchmark ran: build elsewhere meanwhile, "
                "and run again"
            )
        for name in LARGE_RESULTS:
            (run / name).unlink(missing_ok=True)
        timing = timing_figures(run / "timing.json")
        if outcome.exit_code != 0:
            return {**timing, **outcome.failure("run")}
        measured = self._measured(run / "trajectory.tum", with_suffix(bag, ".tum"))
        return {**timing, "exit_code": outcome.exit_code, **measured}

    def _measured(self, estimate: Path, truth: Path) -> Record:
        """Errors of one trajectory, or why there are none."""
        try:
            evaluation = evaluate(
                read_trajectory(str(estimate)), read_trajectory(str(truth)), self._plan.evaluation
            )
        except (UserError, OSError) as error:
            return failure("evaluation", str(error), 0)
        except np.linalg.LinAlgError as error:
            return failure("evaluation", f"{estimate}: cannot be aligned: {error}", 0)
        summary = evaluation.summary()
        return {
            "ok": True,
            "path_m": summary["truth_path_m"],
            "ate_rmse_m": summary["ate_m"]["rmse"],
            "ate_max_m": summary["ate_m"]["max"],
            "relative_percent_long": mean_percent(summary["kitti_segments"]),
            "relative_percent_short": mean_percent(summary["short_segments"]),
            "covered_share": summary["truth_covered_share"],
            "final_error_m": float(evaluation.position_errors_m[-1]),
        }


def with_suffix(bag: Path, suffix: str) -> Path:
    """A file that simulate_bag writes beside FILE.bag; seeds and durations may contain dots."""
    return bag.with_name(bag.name[:-len(".bag")] + suffix)


def mean_percent(segments: Sequence[Record]) -> Optional[float]:
    """The mean over all lengths, the last row, or None where the path was too short."""
    return float(segments[-1]["translation_percent"]) if segments else None


def timing_figures(file: Path) -> Record:
    """Speed and memory of a run; empty if it wrote no (whole) timing.json."""
    timing = read_json(file)
    try:
        return {
            "bag_s": timing["bag_s"],
            "real_time_factor": timing["bag_s"] / timing["wall_s"],
            "cpu_s_per_s": timing["cpu_s"] / timing["bag_s"],
            "peak_memory_mb": timing["peak_memory_mb"],
            "stages_ms": {name: stage["median"] for name, stage in timing["stages"].items()},
        }
    except (TypeError, KeyError, ZeroDivisionError, AttributeError):
        return {}
