"""Reference distributions q_k of the sub-factors, learned from runs in surroundings that count as usual."""

from pathlib import Path
from typing import Dict, Sequence

import numpy as np

from .degeneracy_csv import read_degeneracy
from .degeneracy_evaluation import SUB_FACTORS
from .errors import UserError

SMOOTHING_SCANS = 0.5  # count that each bin starts with, so that no q is zero


def learn(runs: Sequence[Path], bins: int) -> Dict[str, np.ndarray]:
    """q_k of each sub-factor: mean over the runs of their smoothed histograms over [0, 1], so that a long run counts
    as much as a short one.
    """
    columns: Dict[str, list] = {name: [] for name in SUB_FACTORS}
    for run in runs:
        table = read_degeneracy(str(run / "degeneracy.csv"))
        for name in SUB_FACTORS:
            if name not in table.others:
                raise UserError(f"{run}/degeneracy.csv: has no column '{name}': run offline_slam again")
            columns[name].append(histogram(table.others[name], bins))
    return {name: np.mean(found, axis=0) for name, found in columns.items()}


def histogram(values: np.ndarray, bins: int) -> np.ndarray:
    """Shares (n_b + a) / (n + a B); a value of 1 lies in the last bin."""
    index = np.minimum((np.clip(values, 0.0, 1.0) * bins).astype(int), bins - 1)
    counts = np.bincount(index, minlength=bins) + SMOOTHING_SCANS
    return counts / counts.sum()


def parameter_file(references: Dict[str, np.ndarray], scans: int, runs: Sequence[Path]) -> str:
    """YAML that a configuration can include."""
    names = " ".join(run.name for run in runs)
    lines = [
        f"# Reference distributions of the sub-factors, learned by learn_reference.py from {scans} scans of {names}",
        "degeneracy:",
        f"  histogram_bins: {len(next(iter(references.values())))}",
    ]
    for name, shares in references.items():
        lines.append(f'  reference_{name}: "{" ".join(f"{share:.4f}" for share in shares)}"')
    return "\n".join(lines) + "\n"
