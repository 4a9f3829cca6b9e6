"""Reads binary PCD files (x y z, perhaps intensity), thinned out where they are large."""

from pathlib import Path
from typing import Dict, List, Tuple

import numpy as np

from .errors import UserError

MAX_HEADER_BYTES = 4096
NUMPY_KINDS = {"F": "f", "I": "i", "U": "u"}


def read_pcd(path: str, max_points: int) -> Tuple[np.ndarray, int]:
    """A structured array with at most about `max_points` points, evenly taken, and how many the file holds.

    Points with a value that is not finite are dropped. The file is mapped, not read, so that a map of
    gigabytes costs no more memory than the points taken.
    """
    file = Path(path)
    if not file.is_file():
        raise UserError(f"{path}: no such file: check the path")
    entries, offset = _read_header(file)
    dtype = _point_dtype(file, entries)
    if entries.get("DATA") != ["binary"]:
        raise UserError(
            f"{path}: DATA is {' '.join(entries.get('DATA', ['missing']))}: only 'binary' can be read"
        )
    for name in ("x", "y", "z"):
        if name not in dtype.names:
            raise UserError(f"{path}: has no field {name} (it has {', '.join(dtype.names)})")
    count = int(entries.get("POINTS", ["0"])[0])
    if file.stat().st_size < offset + count * dtype.itemsize:
        raise UserError(
            f"{path}: is shorter than its {count} points: the run may have been cut off while saving"
        )
    if count == 0:
        return np.empty(0, dtype=dtype), 0
    points = np.memmap(file, dtype=dtype, mode="r", offset=offset, shape=(count,))
    taken = np.array(points[:: max(1, -(-count // max_points))])
    finite = np.isfinite(taken["x"]) & np.isfinite(taken["y"]) & np.isfinite(taken["z"])
    return taken[finite], count


def _read_header(file: Path) -> Tuple[Dict[str, List[str]], int]:
    """Header entries by keyword, and where the points begin."""
    with file.open("rb") as stream:
        head = stream.read(MAX_HEADER_BYTES)
    data_line = head.find(b"\nDATA ")
    end = head.find(b"\n", data_line + 1)
    if data_line < 0 or end < 0:
        raise UserError(f"{file}: has no PCD header: is it a point cloud of the run?")
    entries: Dict[str, List[str]] = {}
    for line in head[:end].decode("ascii", errors="replace").splitlines():
        words = line.split()
        if words and not words[0].startswith("#"):
            entries[words[0]] = words[1:]
    return entries, end + 1


def _point_dtype(file: Path, entries: Dict[str, List[str]]) -> np.dtype:
    """The layout of one point."""
    try:
        counts = [int(word) for word in entries.get("COUNT", ["1"] * len(entries["FIELDS"]))]
        formats = [f"<{NUMPY_KINDS[kind]}{size}" for kind, size in zip(entries["TYPE"], entries["SIZE"])]
        # padding is named "_", possibly several times, which numpy does not allow
        names = [name if name != "_" else f"_{i}" for i, name in enumerate(entries["FIELDS"])]
        return np.dtype([(n, f) if c == 1 else (n, f, (c,)) for n, f, c in zip(names, formats, counts)])
    except (KeyError, ValueError, TypeError):
        raise UserError(f"{file}: its PCD header is incomplete: was the file cut off while saving?") from None
