"""Whether a run names the direction that the surfaces leave open, by what is true of each scan.

Open: of starts beside the true pose more than OPEN_M is left when the scan is registered by its surfaces alone
(evaluate_registration); the axis that this error lies along is the one to be named. Closed: less than CLOSED_M is left.
Named: a direction of translation with a localizability below WEAK lies within NAMED_DEG of that axis. False alarm: there
is one with such a localizability in a closed scan.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .degeneracy_truth import RegistrationErrors
from .errors import UserError

WEAK = 0.5
OPEN_M = 0.05  # a quarter of what the starts are off
CLOSED_M = 0.02
NAMED_DEG = 10.0
AXES = 6


@dataclass(frozen=True)
class WeakDirections:
    """Verdict on each scan, N booleans each; `is_named` only where `is_open`, `is_alarmed` only where `is_closed`."""

    is_open: np.ndarray
    is_named: np.ndarray
    is_closed: np.ndarray
    is_alarmed: np.ndarray


def read_weak_translations(path: Path, count: int) -> np.ndarray:
    """directions.csv of a run of `count` scans: N x 6 x 3, the unit translations of the axes (IMU frame) whose
    localizability is below WEAK, NaN for the others and for those that are rotations for the greater part."""
    if not path.is_file():
        raise UserError(f"{path}: no such file: keep it, or run offline_slam again")
    rows = np.genfromtxt(path, delimiter=",", names=True)
    if rows.size != AXES * count:
        raise UserError(f"{path}: has {rows.size} lines instead of six a scan: run offline_slam again")
    translations = np.column_stack([rows["tx"], rows["ty"], rows["tz"]])
    lengths = np.linalg.norm(translations, axis=1)
    # An axis is a unit vector of rotation (times a radius) and translation.
    is_weak = (rows["probability"] < WEAK) & (lengths**2 > 0.5)
    translations = translations / np.maximum(lengths, 1e-9)[:, None]
    translations[~is_weak] = np.nan
    return translations.reshape(count, AXES, 3)


def judge_directions(translations: np.ndarray, errors: RegistrationErrors) -> WeakDirections:
    """`translations` as read_weak_translations() gives them."""
    is_open = np.nan_to_num(errors.geometric_m) > OPEN_M
    is_closed = np.nan_to_num(errors.geometric_m, nan=np.inf) < CLOSED_M
    cosines = np.abs(np.einsum("nkc,nc->nk", translations, errors.axis))
    is_named = (np.nan_to_num(cosines) > np.cos(np.radians(NAMED_DEG))).any(axis=1)
    is_alarmed = np.isfinite(translations).all(axis=2).any(axis=1)
    return WeakDirections(is_open, is_open & is_named, is_closed, is_closed & is_alarmed)
