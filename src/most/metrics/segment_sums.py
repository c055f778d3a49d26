"""Segments counted by bins: by how far away they are, or by how many points they have.

A match and a miss count in the bin of the true segment, a false segment in its own. By distance the official rule
says which segments count, so that the bins add up to the official sums of things. By points all of them count, so
that the bins below the official threshold show what the evaluators leave out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64, Int64

from most.metrics.exact_sums import exact_parts
from most.metrics.overlaps import among
from most.metrics.panoptic import Outcomes
from most.metrics.places import Places

DISTANCES = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0)  # m, where bins begin; the last one has no end
POINTS = (1, 15, 50, 100, 200, 500, 1000)  # the official thresholds of both datasets are among them


@dataclass
class SegmentSums:
    """What PQ is made of, by bin and class."""

    tp: Int64[np.ndarray, "bins classes"]
    fp: Int64[np.ndarray, "bins classes"]
    fn: Int64[np.ndarray, "bins classes"]
    iou: Float64[np.ndarray, "2 bins classes"]  # of the matches, in parts that add up exactly in any order

    @classmethod
    def zeros(cls, bins: int, num_classes: int) -> "SegmentSums":
        """The sums of no scan at all."""
        tp, fp, fn = np.zeros((3, bins, num_classes), dtype=np.int64)
        return cls(tp, fp, fn, np.zeros((2, bins, num_classes)))

    @classmethod
    def of(
        cls,
        outcomes: Outcomes,
        true_bins: Int64[np.ndarray, "true"],
        pred_bins: Int64[np.ndarray, "predicted"],
        bins: int,
        num_classes: int,
    ) -> "SegmentSums":
        """Count one scan's segments, whose bins are given."""

        def count(of: Int64[np.ndarray, "items"], classes: Int64[np.ndarray, "items"], weights: Any = None) -> Any:
            return np.bincount(of * num_classes + classes, weights, bins * num_classes).reshape(bins, num_classes)

        matched = true_bins[outcomes.match.truth]
        parts = exact_parts(torch.from_numpy(outcomes.match.iou)).numpy()
        return cls(
            tp=count(matched, outcomes.tp),
            fp=count(pred_bins[outcomes.false], outcomes.fp),
            fn=count(true_bins[outcomes.missed], outcomes.fn),
            iou=np.stack([count(matched, outcomes.tp, part).astype(np.float64) for part in parts]),
        )

    def __add__(self, other: "SegmentSums") -> "SegmentSums":
        return SegmentSums(*(getattr(self, field.name) + getattr(other, field.name) for field in fields(self)))

    def of_classes(self, chosen: Sequence[int]) -> "SegmentSums":
        """The same with nothing of other classes."""
        own = among(np.arange(self.tp.shape[-1]), chosen)
        return SegmentSums(*(getattr(self, field.name) * own for field in fields(self)))

    def plain(self) -> dict[str, Any]:
        """Return ``{tp, fp, fn, iou}``, each a list of bins of lists of classes."""
        return {name: getattr(self, name).tolist() for name in ("tp", "fp", "fn")} | {"iou": self.iou.sum(0).tolist()}


def by_distance(outcomes: Outcomes, places: Places, num_classes: int, things: Sequence[int]) -> SegmentSums:
    """Count the things that count officially by their distance."""
    true_bins, pred_bins = (np.searchsorted(DISTANCES, d, "right") - 1 for d in (places.truth, places.pred))
    return SegmentSums.of(outcomes, true_bins, pred_bins, len(DISTANCES), num_classes).of_classes(things)


def by_points(outcomes: Outcomes, num_classes: int, things: Sequence[int]) -> SegmentSums:
    """Count things by their points; ``outcomes`` are those from one point on."""
    known = outcomes.overlaps
    areas = (known.truth_areas, known.pred_areas)
    true_bins, pred_bins = (np.searchsorted(POINTS, area, "right") - 1 for area in areas)
    return SegmentSums.of(outcomes, true_bins, pred_bins, len(POINTS), num_classes).of_classes(things)
