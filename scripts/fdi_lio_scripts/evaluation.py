"""One evaluation: an estimate against one ground truth, with everything that the tables and plots show."""

from dataclasses import asdict, dataclass
from typing import Any, Dict, List

import numpy as np

from . import metrics
from .alignment import Alignment, align
from .association import Pairs, associate
from .trajectory import Trajectory


@dataclass(frozen=True)
class Settings:
    """Choices of one evaluation; the defaults are those of `evo_ape tum --align`."""

    max_diff_s: float = 0.01
    interpolate: bool = False
    once: bool = False
    align: str = "se3"
    rpe_delta: int = 1
    max_gap_s: float = 1.0


@dataclass(frozen=True)
class Evaluation:
    """Results. `pairs` holds the estimate as it came, `aligned` in the frame of the truth."""

    settings: Settings
    truth: Trajectory
    pairs: Pairs
    aligned: Trajectory
    alignment: Alignment
    position_errors_m: np.ndarray
    rotation_errors_deg: np.ndarray
    rpe: metrics.RelativeErrors
    kitti: List[metrics.SegmentErrors]
    short_segments: List[metrics.SegmentErrors]
    covered_share: float
    longest_gap_s: float

    def summary(self) -> Dict[str, Any]:
        """All figures as plain numbers, for JSON."""
        return {
            "estimate": self.pairs.estimate.name,
            "ground_truth": self.truth.name,
            "settings": asdict(self.settings),
            "matched_poses": len(self.aligned),
            "reused_poses": self.pairs.reused,
            "ate_m": metrics.statistics(self.position_errors_m),
            "rotation_deg": metrics.statistics(self.rotation_errors_deg),
            "rpe_translation_m": statistics_or_none(self.rpe.translation_m),
            "rpe_rotation_deg": statistics_or_none(self.rpe.rotation_deg),
            "kitti_segments": [asdict(row) for row in self.kitti],
            "short_segments": [asdict(row) for row in self.short_segments],
            "truth_covered_share": self.covered_share,
            "longest_gap_s": self.longest_gap_s,
            "truth_duration_s": self.truth.duration_s,
            "truth_path_m": float(self.truth.distances_m()[-1]),
            "matched_truth_path_m": float(self.pairs.truth.distances_m()[-1]),
            "matched_estimate_path_m": float(self.aligned.distances_m()[-1]),
            "alignment": {
                "scale": self.alignment.scale,
                "rotation": self.alignment.rotation.tolist(),
                "translation_m": self.alignment.translation.tolist(),
            },
        }


def statistics_or_none(errors: np.ndarray) -> Any:
    """Statistics, or None where there was nothing to compare."""
    return metrics.statistics(errors) if len(errors) else None


def evaluate(estimate: Trajectory, truth: Trajectory, settings: Settings) -> Evaluation:
    """Pairs, aligns and measures `estimate` against `truth`."""
    pairs = associate(estimate, truth, settings.max_diff_s, settings.interpolate, settings.once)
    alignment = align(pairs.estimate, pairs.truth, settings.align)
    aligned = alignment.apply(pairs.estimate)
    kitti = metrics.segment_errors(aligned, pairs.truth, metrics.KITTI_LENGTHS_M)
    # A path that does not hold the longest standard segment says more when short ones are measured too.
    path_m = pairs.truth.distances_m()[-1]
    is_short = path_m <= metrics.KITTI_LENGTHS_M[-1]
    short_segments = metrics.segment_errors(aligned, pairs.truth, metrics.SHORT_LENGTHS_M) if is_short else []
    stamps = pairs.truth.stamps
    return Evaluation(
        settings=settings,
        truth=truth,
        pairs=pairs,
        aligned=aligned,
        alignment=alignment,
        position_errors_m=metrics.position_errors_m(aligned, pairs.truth),
        rotation_errors_deg=metrics.rotation_errors_deg(aligned, pairs.truth),
        rpe=metrics.consecutive_errors(aligned, pairs.truth, settings.rpe_delta),
        kitti=kitti,
        short_segments=short_segments,
        covered_share=metrics.covered_share(stamps, truth, settings.max_gap_s),
        longest_gap_s=float(np.diff(stamps).max()),
    )
