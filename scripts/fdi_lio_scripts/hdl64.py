"""Ring and time of the points of a KITTI scan, which stores neither.

KITTI stores a scan ring by ring from the highest beam to the lowest, each ring counter-clockwise from
straight ahead (azimuth 0 to 360 degrees). So a new ring begins where the azimuth falls back. On 77 whole
scans of 2011_09_26 (HDL-64E) this finds exactly 64 rings each time, while the elevation of one ring varies by
more than 4 degrees, ten times the spacing of the beams: the lasers sit up to 0.2 m from the centre, which
near points show.
"""

from typing import Tuple

import numpy as np

RING_COUNT = 64
# Elevation of each beam of KITTI's own HDL-64E, from the highest down, in degrees: FAR_QUANTILE of each ring,
# median over the scans of 2011_09_26. They lie within 0.1 degrees of this in every scan but for the six
# lowest, which hit the car. Beams of the data sheet (1/3 degree apart from +2, 1/2 degree from -8.83) are up
# to 0.7 degrees off.
FAR_QUANTILE = 0.01  # distant points show the beam's elevation; near ones look higher than it
BEAM_ELEVATIONS_DEG = np.array([
    2.10, 1.74, 1.48, 1.05, 0.78, 0.36, 0.09, -0.26, -0.59, -0.99, -1.26, -1.60, -1.97, -2.30, -2.62, -2.98,
    -3.28, -3.66, -3.93, -4.28, -4.59, -4.90, -5.21, -5.52, -5.84, -6.11, -6.40, -6.66, -7.03, -7.38, -7.60,
    -7.97,
    -8.51, -9.03, -9.49, -9.86, -10.31, -10.91, -11.40, -11.82, -12.27, -12.69, -13.22, -13.74, -14.30,
    -14.74,
    -15.23, -15.59, -16.19, -16.71, -17.27, -17.72, -18.23, -18.61, -19.07, -19.62, -20.12, -20.81, -21.21,
    -21.60,
    -22.04, -22.67, -23.20, -23.67,
])


def rings_of(xyz: np.ndarray) -> Tuple[np.ndarray, str]:
    """Ring of each point, 0 the lowest beam as in the Velodyne driver, and how it was found.

    "order": all 64 rings were there. "order, n rings": some beam saw nothing or the file is cut short; the
    rings that exist are matched to the beams by elevation, keeping their order. "elevation": the points are
    not in KITTI's order.
    """
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0]) % (2 * np.pi)
    group = np.concatenate([[0], np.cumsum(np.diff(azimuth) < -np.pi)]).astype(int)[: len(xyz)]
    count = int(group[-1]) + 1 if len(group) else 0
    elevation = np.degrees(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1])))
    if count == RING_COUNT:
        from_top, how = group, "order"
    elif 0 < count < RING_COUNT:
        ends = np.flatnonzero(np.diff(group)) + 1
        far = np.array([np.quantile(part, FAR_QUANTILE) for part in np.split(elevation, ends)])
        from_top, how = match_in_order(far, BEAM_ELEVATIONS_DEG)[group], f"order, {count} rings"
    else:
        from_top = np.argmin(np.abs(elevation[:, None] - BEAM_ELEVATIONS_DEG), axis=1)
        how = "elevation"
    return (RING_COUNT - 1 - from_top).astype(np.uint16), how


def match_in_order(found: np.ndarray, beams: np.ndarray) -> np.ndarray:
    """Index into `beams` for each of `found`, strictly increasing, with the least sum of absolute
    differences.

    Dynamic programme: best[i, j] is the cost of matching found[:i] to elements of beams[:j].
    """
    cost = np.abs(found[:, None] - beams[None, :])
    best = np.full((len(found) + 1, len(beams) + 1), np.inf)
    best[0] = 0.0
    for i in range(1, len(found) + 1):
        for j in range(i, len(beams) + 1):
            best[i, j] = min(best[i, j - 1], best[i - 1, j - 1] + cost[i - 1, j - 1])
    chosen = np.zeros(len(found), dtype=int)
    j = len(beams)
    for i in range(len(found), 0, -1):
        while best[i, j - 1] <= best[i, j]:
            j -= 1
        j -= 1
        chosen[i - 1] = j
    return chosen


def sweep_share(xyz: np.ndarray, clockwise: bool = True) -> np.ndarray:
    """Share of the sweep that was over when a point was measured, in [0, 1).

    A sweep begins straight behind the car; half-way the head looks forward and triggers the cameras.
    Clockwise seen from above it passes the left side first: share = (pi - azimuth) / (2 pi).
    docs/evaluation.md says why clockwise. The lasers' own horizontal angles (some degrees) are not in KITTI's
    files: about 2 ms of error.
    """
    azimuth = np.arctan2(xyz[:, 1].astype(np.float64), xyz[:, 0].astype(np.float64))
    share = (np.pi - azimuth if clockwise else np.pi + azimuth) / (2 * np.pi)
    return np.clip(share, 0.0, np.nextafter(1.0, 0.0))
