"""A map seen from above as a picture: each pixel shows the highest point or the mean intensity below it."""

from typing import Tuple

import numpy as np

from . import plots
from .trajectory import Trajectory

PIXELS = 1500  # along the longer side
MIN_PIXEL_M = 0.05
OUTLIER_SHARE = 0.002  # points cut at each border, so that a few stray returns do not shrink the map


def raster(points: np.ndarray, values: np.ndarray, highest: bool) -> Tuple[
    np.ndarray, Tuple[float, float, float, float]
]:
    """Rows x columns of the highest or the mean value (NaN where no point is), and left, right, bottom, top
    in metres.
    """
    x, y = points["x"].astype(float), points["y"].astype(float)
    shares = [OUTLIER_SHARE, 1 - OUTLIER_SHARE]
    (left, right), (bottom, top) = np.quantile(x, shares), np.quantile(y, shares)
    pixel = max((right - left) / PIXELS, (top - bottom) / PIXELS, MIN_PIXEL_M)
    columns, rows = int((right - left) / pixel) + 1, int((top - bottom) / pixel) + 1
    column, row = ((x - left) / pixel).astype(int), ((y - bottom) / pixel).astype(int)
    inside = (x >= left) & (y >= bottom) & (column < columns) & (row < rows)
    cell = row[inside] * columns + column[inside]
    chosen = values[inside].astype(float)
    if highest:
        image = np.full(rows * columns, -np.inf)
        np.maximum.at(image, cell, chosen)
        image[np.isinf(image)] = np.nan
    else:
        counts = np.bincount(cell, minlength=rows * columns)
        sums = np.bincount(cell, weights=chosen, minlength=rows * columns)
        image = np.divide(sums, counts, out=np.full(rows * columns, np.nan), where=counts > 0)
    return image.reshape(rows, columns), (left, left + columns * pixel, bottom, bottom + rows * pixel)


def draw_map(axes: plots.Axes, points: np.ndarray, field: str, label: str, path: Trajectory = None) -> None:
    """The map coloured by `field` ("z" or "intensity"), with the path on it, if given."""
    image, extent = raster(points, points[field], highest=field == "z")
    seen = image[np.isfinite(image)]
    # Robust limits: a few reflectors or treetops must not make the rest one colour.
    low, high = np.quantile(seen, [0.02, 0.98]) if len(seen) else (0.0, 1.0)
    colours = plots.colour_map("turbo" if field == "z" else "inferno")
    picture = axes.imshow(
        image, origin="lower", extent=extent, cmap=colours, vmin=low, vmax=max(high, low + 1e-6),
        interpolation="nearest"
    )
    if path is not None:
        axes.plot(path.positions[:, 0], path.positions[:, 1], color="white", lw=1.0, alpha=0.9)
    axes.set_facecolor("#101418")
    axes.grid(False)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    left, right, bottom, top = extent
    plots.fit_height(axes.figure, right - left, top - bottom)
    axes.figure.colorbar(picture, ax=axes, label=label, shrink=0.8)
