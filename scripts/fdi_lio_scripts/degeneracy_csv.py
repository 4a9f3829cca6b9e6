"""Reads degeneracy.csv: one row a scan, with `stamp`, `fdi`, perhaps `class`, and any other numeric columns.
"""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List

import numpy as np

from .errors import UserError


@dataclass(frozen=True)
class Degeneracy:
    """stamps in seconds; fdi in [0, 1]; class names (empty strings without the column); other numeric
    columns.
    """

    stamps: np.ndarray
    fdi: np.ndarray
    classes: List[str]
    others: Dict[str, np.ndarray]


def read_degeneracy(path: str) -> Degeneracy:
    """Reads the file; columns are found by their header."""
    if not Path(path).is_file():
        raise UserError(f"{path}: no such file: check the path")
    with open(path, encoding="utf-8", newline="") as stream:
        rows = [row for row in csv.reader(stream, skipinitialspace=True) if row]
    if not rows:
        raise UserError(f"{path}: is empty: check that the run wrote it")
    header = [name.strip().lstrip("# ") for name in rows[0]]
    for needed in ("stamp", "fdi"):
        if needed not in header:
            raise UserError(
                f"{path}: has no column '{needed}' (it has {', '.join(header)}): is it a degeneracy.csv?"
            )
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise UserError(
                f"{path}: line {number} has {len(row)} columns instead of {len(header)}: was it cut short?"
            )
    columns = {name: [row[i] for row in rows[1:]] for i, name in enumerate(header)}
    classes = [name.strip() for name in columns.pop("class", [""] * (len(rows) - 1))]
    numbers = {
        name: values for name, values in ((n, _numbers(c)) for n, c in columns.items()) if values is not None
    }
    for needed in ("stamp", "fdi"):
        if needed not in numbers:
            raise UserError(
                f"{path}: column '{needed}' holds something that is no number: is it a degeneracy.csv?"
            )
    return Degeneracy(numbers.pop("stamp"), numbers.pop("fdi"), classes, numbers)


def _numbers(cells: List[str]):
    """The column as floats, or None if it is text."""
    try:
        return np.array([float(cell) for cell in cells])
    except ValueError:
        return None
