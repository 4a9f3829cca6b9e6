"""Figures of a benchmark over its cells: medians by scenario, and ratios between configurations."""

from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Optional, Sequence

import numpy as np

from .benchmark_cells import Record

ALL = "all"  # stands for all scenarios together
RESAMPLES = 10000
RESAMPLING_SEED = 20240501  # fixed: the same cells give the same interval
SMALLEST_ATE_M = 1e-6  # a smaller error says nothing about a lidar, and zero has no ratio


@dataclass(frozen=True)
class Spread:
    """Median, smallest and largest value over the seeds."""

    median: float
    low: float
    high: float
    count: int


@dataclass(frozen=True)
class Ratio:
    """Geometric mean of the ATE ratios of one configuration to the first. No interval with a single seed."""

    configuration: str
    scenario: str
    cells: int  # with a result on both sides
    left_out: int  # where one side failed
    ratio: Optional[float]
    low: Optional[float]
    high: Optional[float]


def unique(records: Sequence[Record], key: str) -> List[Any]:
    """Values of a key in the order of their first use."""
    return list(dict.fromkeys(record[key] for record in records))


def select(records: Sequence[Record], scenario: str, configuration: str) -> List[Record]:
    """The cells of one scenario and configuration."""
    return [r for r in records if r["scenario"] == scenario and r["configuration"] == configuration]


def values(records: Sequence[Record], key: str) -> List[float]:
    """A figure of all finished cells that have it."""
    return [float(r[key]) for r in records if r.get("ok") and r.get(key) is not None]


def spread(records: Sequence[Record], key: str) -> Optional[Spread]:
    """Median and range of a figure, or None if no cell has it."""
    found = values(records, key)
    return Spread(float(np.median(found)), min(found), max(found), len(found)) if found else None


def relative_key(records: Sequence[Record], scenario: str) -> str:
    """KITTI's segments (100 to 800 m) where every finished cell of the scenario has them, else 10 to 50 m."""
    finished = [r for r in records if r["scenario"] == scenario and r.get("ok")]
    is_long = all(r.get("relative_percent_long") is not None for r in finished)
    return "relative_percent_long" if is_long else "relative_percent_short"


def geometric_mean_ratio(log_ratios: Dict[str, np.ndarray]) -> tuple:
    """(ratio, low, high): geometric mean over all cells, with a 95 % bootstrap interval over the seeds.

    `log_ratios`: for each scenario the logarithm of the ratio of each seed. Each resample draws as many seeds,
    with replacement, within every scenario. low and high are None if a scenario has a single seed.
    """
    count = sum(len(logs) for logs in log_ratios.values())
    if count == 0:
        return None, None, None
    mean = sum(logs.sum() for logs in log_ratios.values()) / count
    if any(len(logs) == 1 for logs in log_ratios.values()):
        return float(np.exp(mean)), None, None
    random = np.random.default_rng(RESAMPLING_SEED)
    sums = np.zeros(RESAMPLES)
    for logs in log_ratios.values():
        if len(logs):
            sums += logs[random.integers(0, len(logs), (RESAMPLES, len(logs)))].sum(axis=1)
    low, high = np.exp(np.percentile(sums / count, [2.5, 97.5]))
    return float(np.exp(mean)), float(low), float(high)


def ratios(records: Sequence[Record]) -> List[Ratio]:
    """Each further column against the first: by scenario, and over all scenarios."""
    configurations = unique(records, "configuration")
    scenarios = unique(records, "scenario")
    found: List[Ratio] = []
    for configuration in configurations[1:]:
        logs: Dict[str, np.ndarray] = {}
        left_out: Dict[str, int] = {}
        for scenario in scenarios:
            first = {r["seed"]: r for r in select(records, scenario, configurations[0])}
            other = {r["seed"]: r for r in select(records, scenario, configuration)}
            pairs = [(first[seed], other[seed]) for seed in first if seed in other]
            both = [pair for pair in pairs if pair[0].get("ok") and pair[1].get("ok")]
            logs[scenario] = np.array([_log_ate(b) - _log_ate(a) for a, b in both], float)
            left_out[scenario] = len(first) - len(both)
            found.append(_ratio(configuration, scenario, {scenario: logs[scenario]}, left_out[scenario]))
        if len(scenarios) > 1:
            found.append(_ratio(configuration, ALL, logs, sum(left_out.values())))
    return found


def _log_ate(record: Record) -> float:
    return float(np.log(max(record["ate_rmse_m"], SMALLEST_ATE_M)))


def _ratio(configuration: str, scenario: str, logs: Dict[str, np.ndarray], left_out: int) -> Ratio:
    cells = sum(len(array) for array in logs.values())
    return Ratio(configuration, scenario, cells, left_out, *geometric_mean_ratio(logs))


def stage_medians(records: Sequence[Record]) -> Dict[str, float]:
    """Median over the cells of the median time of each stage, in ms."""
    times: Dict[str, List[float]] = {}
    for record in records:
        for name, value in record.get("stages_ms", {}).items():
            times.setdefault(name, []).append(float(value))
    return {name: float(np.median(found)) for name, found in times.items()}


def for_each(
    records: Sequence[Record], make: Callable[[str, str, List[Record]], Any]
) -> List[Any]:
    """make(scenario, configuration, cells) for each pair that has cells."""
    made: List[Any] = []
    for scenario in unique(records, "scenario"):
        for configuration in unique(records, "configuration"):
            cells = select(records, scenario, configuration)
            if cells:
                made.append(make(scenario, configuration, cells))
    return made
