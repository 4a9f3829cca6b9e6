"""Writes the output folder of a run, as offline_slam does."""

import json
from pathlib import Path

import numpy as np
from trajectories import write_tum

from fdi_lio_scripts.trajectory import Trajectory


def write_pcd(path: Path, points: np.ndarray) -> None:
    """Binary PCD of N x 4 float32: x y z intensity."""
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 "
        "4\nTYPE F F F F\n"
        f"COUNT 1 1 1 1\nWIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA "
        "binary\n"
    )
    path.write_bytes(header.encode() + points.astype("<f4").tobytes())


def street_map(path_positions: np.ndarray, count: int = 200_000) -> np.ndarray:
    """Ground with lane paint and two walls of houses beside a path."""
    random = np.random.default_rng(11)
    centre = path_positions[random.integers(0, len(path_positions), count)]
    heading = np.gradient(path_positions, axis=0)
    side = np.stack([-heading[:, 1], heading[:, 0]], axis=1)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    index = random.integers(0, len(path_positions), count)
    centre, side = path_positions[index], side[index]
    across = random.uniform(-12, 12, count)
    wall = np.abs(across) > 9
    across[wall] = np.sign(across[wall]) * (9 + random.normal(0, 0.05, wall.sum()))
    z = np.where(wall, random.uniform(-1.7, 8, count), -1.7 + random.normal(0, 0.02, count)) + centre[:, 2]
    paint = (np.abs(across) < 0.15) | (np.abs(np.abs(across) - 4) < 0.1)
    intensity = np.where(paint, 90, np.where(wall, 40, 12)) + random.normal(0, 4, count)
    xy = centre[:, :2] + across[:, None] * side + random.normal(0, 0.3, (count, 1)) * heading[index, :2]
    return np.column_stack([xy, z, intensity])


def write_run(folder: Path, trajectory: Trajectory) -> Path:
    """All files of a run."""
    folder.mkdir(parents=True, exist_ok=True)
    write_tum(folder / "trajectory.tum", trajectory)
    write_pcd(folder / "map.pcd", street_map(trajectory.positions))
    classes = ["structured", "sparse", "dynamic", "mixed"]
    lines = ["stamp,fdi,structural,sparse,dynamic,class,entropy,plane_deviation,constant"]
    count = len(trajectory)
    for i, stamp in enumerate(trajectory.stamps):
        phase = 2 * np.pi * i / count
        sine, cosine = np.sin(phase), np.cos(phase)
        factors = f"{0.5 + 0.4 * sine:.4f},{0.4 + 0.3 * cosine:.4f},{0.2 + 0.1 * np.sin(3 * phase):.4f}"
        metrics = f"{4 + cosine:.3f},{0.02 + 0.01 * np.sin(5 * phase):.4f},1"
        lines.append(f"{stamp:.9f},{0.45 + 0.3 * sine:.4f},{factors},{classes[4 * i // count]},{metrics}")
    (folder / "degeneracy.csv").write_text("\n".join(lines) + "\n")
    stage = {"count": count, "mean": 4.0, "median": 3.5, "p95": 7.0, "p99": 9.0, "max": 12.5}
    timing = {"stages": {
        "deskew": stage, "scan matching": {**stage, "mean": 12.0}
    }, "wall_s": 20.0, "cpu_s": 31.0,
              "peak_memory_mb": 412.0, "bag_s": 100.0}
    (folder / "timing.json").write_text(json.dumps(timing))
    (folder / "warnings.txt").write_text("IMU gap of 0.13 s at 12.4 s: covariance inflated\nx < y & z\n")
    (folder / "run.yaml").write_text("sensor:\n  ring_count: 64\n")
    return folder
