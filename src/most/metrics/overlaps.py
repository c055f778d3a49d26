"""Which segments of a scan's prediction and truth share points, and how many: the one pass over the points.

A scan has some hundred such pairs, and every panoptic and tracking figure is arithmetic on them.
"""

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64
from torch import Tensor

from most.metrics.renumber import Integers, renumber


@dataclass
class Segments:
    """The distinct (class, key) pairs of one labelling of a scan, ascending by key; class 0 is void."""

    classes: Int64[np.ndarray, "segments"]
    keys: Int64[np.ndarray, "segments"]


class Matches(NamedTuple):
    """Pairs of a predicted and a true segment (indices) with their intersection over union."""

    pred: Int64[np.ndarray, "matches"]
    truth: Int64[np.ndarray, "matches"]
    iou: Float64[np.ndarray, "matches"]

    def where(self, chosen: Bool[np.ndarray, "matches"]) -> "Matches":
        """Only the chosen ones."""
        return Matches(self.pred[chosen], self.truth[chosen], self.iou[chosen])


@dataclass
class Overlaps:
    """The pairs of a predicted and a true segment that share points; ``points`` says how many."""

    pred: Segments
    truth: Segments
    pred_of: Int64[np.ndarray, "pairs"]  # index of the pair's predicted segment
    truth_of: Int64[np.ndarray, "pairs"]
    points: Int64[np.ndarray, "pairs"]

    @cached_property
    def pred_areas(self) -> Int64[np.ndarray, "segments"]:
        """Points of each predicted segment; 0 for one that lost all its pairs."""
        return totals(self.pred_of, self.points, len(self.pred.keys))

    @cached_property
    def truth_areas(self) -> Int64[np.ndarray, "segments"]:
        """Points of each true segment."""
        return totals(self.truth_of, self.points, len(self.truth.keys))

    @cached_property
    def matches_above_half(self) -> Matches:
        """Pairs whose IoU is above one half, of whatever classes; no segment can have two."""
        union = self.truth_areas[self.truth_of] + self.pred_areas[self.pred_of] - self.points
        return Matches(self.pred_of, self.truth_of, self.points / union).where(2 * self.points > union)

    @cached_property
    def known(self) -> "Overlaps":
        """Without the points whose truth is void, for which no evaluator gives credit or blame."""
        known = self.truth.classes[self.truth_of] != 0
        return Overlaps(self.pred, self.truth, self.pred_of[known], self.truth_of[known], self.points[known])

    def by_predicted_key(self) -> "Overlaps":
        """Predicted segments told apart by their keys alone; they lose their classes (all 0)."""
        keys, key_of_segment = renumber(self.pred.keys)
        pred = Segments(np.zeros_like(keys), keys)
        if len(keys) == len(self.pred.keys):  # as with whole labels: segments ascend by key
            return Overlaps(pred, self.truth, self.pred_of, self.truth_of, self.points)
        pairs, pair = renumber(self.truth_of * len(keys) + key_of_segment[self.pred_of])
        truth_of, pred_of = np.divmod(pairs, len(keys))
        return Overlaps(pred, self.truth, pred_of, truth_of, totals(pair, self.points, len(pairs)))


def find_overlaps(
    pred_semantics: Int64[Tensor, "points"],
    pred_keys: Int64[Tensor, "points"],
    truth_semantics: Int64[Tensor, "points"],
    truth_keys: Int64[Tensor, "points"],
) -> Overlaps:
    """Cross-tabulate one scan; classes are training ids (0 is void), keys whatever tells segments of a class apart."""
    columns = (pred_semantics, pred_keys, truth_semantics, truth_keys)
    (pred_sem, pred_key, truth_sem, truth_key), length = _runs([column.cpu().numpy() for column in columns])
    pred, pred_of_run = _segments(pred_sem, pred_key)
    truth, truth_of_run = _segments(truth_sem, truth_key)
    count = max(len(pred.keys), 1)
    pairs, pair = renumber(truth_of_run * count + pred_of_run)
    truth_of, pred_of = np.divmod(pairs, count)
    return Overlaps(pred, truth, pred_of, truth_of, totals(pair, length, len(pairs)))


def among(classes: Int64[np.ndarray, "items"], chosen: Collection[int]) -> Bool[np.ndarray, "items"]:
    """Whether each class is one of those chosen; ``numpy.isin`` takes longer for a few."""
    is_chosen = np.zeros(max(int(classes.max(initial=0)), *chosen, 0) + 1, dtype=bool)
    is_chosen[list(chosen)] = True
    return is_chosen[classes]


def totals(index: Integers, amounts: Integers, size: int) -> Integers:
    """Sum the amounts that fall on each of ``size`` indices, exactly below 2**53."""
    return np.bincount(index, weights=amounts, minlength=size).astype(np.int64)


def _runs(columns: list[Integers]) -> tuple[list[Integers], Integers]:
    """Merge neighbours that agree in every column, and count them: along a beam most do, so little work is left."""
    count = len(columns[0])
    starts = np.zeros(count, dtype=bool)
    starts[:1] = True
    for column in columns:
        starts[1:] |= column[1:] != column[:-1]
    first = np.flatnonzero(starts)
    return [column[first] for column in columns], np.diff(first, append=count)


def _segments(semantics: Integers, keys: Integers) -> tuple[Segments, Integers]:
    """The distinct pairs of class and key, and the index of each run's pair."""
    distinct, key_of_run = renumber(keys)
    num_classes = int(semantics.max(initial=0)) + 1
    codes, segment_of_run = renumber(key_of_run * num_classes + semantics)
    return Segments(codes % num_classes, distinct[codes // num_classes]), segment_of_run
