"""Panoptic quality as the benchmarks' official evaluators define it, in one pass over a scan (paper, Tables I to IV).

A segment is a (class, key) pair, where the key is the *whole* raw label: labels of one class may differ in more than
the instance id, and the official evaluators tell segments apart by all of it. Stuff is keyed like things. Points whose
truth is void count for nothing; segments of one class that overlap by more than half match (a true positive);
unmatched segments count only from ``min_points`` points on. Figures are fractions in [0, 1], in float64.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from most.metrics.means import mean
from most.metrics.overlaps import Matches, Overlaps, find_overlaps, totals

EPS = 1e-15  # the official evaluators' guard: a class that never occurs scores 0, and stays in the means


@dataclass
class PanopticStatistics:
    """What scans add to the panoptic figures: statistics are summed over all scans, and divided only then."""

    confusion: Int64[Tensor, "classes classes"]  # points, indexed [predicted, truth], void included
    iou_sum: Float64[Tensor, "classes"]  # over the true positives
    tp: Int64[Tensor, "classes"]  # segments; fp and fn likewise
    fp: Int64[Tensor, "classes"]
    fn: Int64[Tensor, "classes"]

    @classmethod
    def zeros(cls, num_classes: int) -> "PanopticStatistics":
        """The statistics of no scan at all; ``num_classes`` includes void."""
        counts = (torch.zeros(num_classes, dtype=torch.int64) for _ in range(3))
        confusion = torch.zeros(num_classes, num_classes, dtype=torch.int64)
        return cls(confusion, torch.zeros(num_classes, dtype=torch.float64), *counts)

    def __add__(self, other: "PanopticStatistics") -> "PanopticStatistics":
        return PanopticStatistics(*(getattr(self, field.name) + getattr(other, field.name) for field in fields(self)))


@dataclass
class ClassFigures:
    """The figures of each class; void's are zero and enter no mean."""

    pq: Float64[Tensor, "classes"]
    sq: Float64[Tensor, "classes"]
    rq: Float64[Tensor, "classes"]
    iou: Float64[Tensor, "classes"]


def panoptic_statistics(
    pred_semantics: Int64[Tensor, "points"],
    pred_keys: Int64[Tensor, "points"],
    truth_semantics: Int64[Tensor, "points"],
    truth_keys: Int64[Tensor, "points"],
    num_classes: int,
    min_points: int,
) -> PanopticStatistics:
    """Compare one scan's prediction with its truth; keys are raw labels, classes training ids (0 is void)."""
    overlaps = find_overlaps(pred_semantics, pred_keys, truth_semantics, truth_keys)
    return panoptic_statistics_of(overlaps, num_classes, min_points)


def panoptic_statistics_of(overlaps: Overlaps, num_classes: int, min_points: int) -> PanopticStatistics:
    """The same from overlaps that are found already."""
    segments = outcomes(overlaps, min_points)
    iou_sum = np.bincount(segments.tp, segments.match.iou, num_classes).astype(np.float64)  # integers for no items
    return PanopticStatistics(
        confusion=confusion_of(overlaps, num_classes),
        iou_sum=torch.from_numpy(iou_sum),
        tp=torch.from_numpy(np.bincount(segments.tp, minlength=num_classes)),
        fp=torch.from_numpy(np.bincount(segments.fp, minlength=num_classes)),
        fn=torch.from_numpy(np.bincount(segments.fn, minlength=num_classes)),
    )


@dataclass
class Outcomes:
    """What became of a scan's segments: matched, or counted as false or missed."""

    overlaps: Overlaps  # of points whose truth is known
    match: Matches
    false: Int64[np.ndarray, "false"]  # indices of predicted segments
    missed: Int64[np.ndarray, "missed"]  # indices of true segments

    @property
    def tp(self) -> Int64[np.ndarray, "matches"]:
        """The class of each match."""
        return self.overlaps.truth.classes[self.match.truth]

    @property
    def fp(self) -> Int64[np.ndarray, "false"]:
        """The class of each false segment."""
        return self.overlaps.pred.classes[self.false]

    @property
    def fn(self) -> Int64[np.ndarray, "missed"]:
        """The class of each missed segment."""
        return self.overlaps.truth.classes[self.missed]


def outcomes(overlaps: Overlaps, min_points: int) -> Outcomes:
    """Tell true positives from false positives and misses, which count from ``min_points`` known points on."""
    known = overlaps.known
    match = true_positives(known)
    false = (known.pred_areas >= max(min_points, 1)) & (known.pred.classes != 0)
    missed = known.truth_areas >= max(min_points, 1)
    false[match.pred] = False
    missed[match.truth] = False
    return Outcomes(known, match, np.flatnonzero(false), np.flatnonzero(missed))


def true_positives(known: Overlaps) -> Matches:
    """The segments of one class that overlap by more than half; ``known`` has no points of void truth."""
    match = known.matches_above_half
    return match.where(known.pred.classes[match.pred] == known.truth.classes[match.truth])


def confusion_of(overlaps: Overlaps, num_classes: int) -> Int64[Tensor, "classes classes"]:
    """Points of each pair of classes, indexed [predicted, truth]."""
    pred, truth = overlaps.pred.classes[overlaps.pred_of], overlaps.truth.classes[overlaps.truth_of]
    points = totals(pred * num_classes + truth, overlaps.points, num_classes**2)
    return torch.from_numpy(points).view(num_classes, num_classes)


def class_figures(statistics: PanopticStatistics) -> ClassFigures:
    """PQ = SQ RQ of each class, and its IoU over points, where a known point predicted void is a miss."""
    tp = statistics.tp.double()
    sq = statistics.iou_sum / tp.clamp(min=EPS)
    rq = tp / (tp + statistics.fp / 2 + statistics.fn / 2).clamp(min=EPS)
    return ClassFigures(sq * rq, sq, rq, PointCounts.of(statistics.confusion).iou())


@dataclass
class PointCounts:
    """Points of known truth by class: predicted rightly, predicted at all, and there to be found."""

    hits: Float64[Tensor, "classes"]
    predicted: Float64[Tensor, "classes"]
    true: Float64[Tensor, "classes"]

    @classmethod
    def of(cls, confusion: Int64[Tensor, "classes classes"]) -> "PointCounts":
        """Count from a confusion matrix indexed [predicted, truth]; points of void truth are left out."""
        known = confusion.double()
        known[:, 0] = 0
        return cls(known.diagonal(), known.sum(1), known.sum(0))

    def union(self) -> Float64[Tensor, "classes"]:
        """Points that are of a class by prediction or by truth."""
        return self.predicted + self.true - self.hits

    def iou(self) -> Float64[Tensor, "classes"]:
        """0 for a class that never occurs."""
        return self.hits / self.union().clamp(min=EPS)


def panoptic_figures(statistics: PanopticStatistics, things: Sequence[int]) -> dict[str, float]:
    """``pq sq rq miou`` over all classes but void, each also ``_things`` and ``_stuff``; ``pq_dagger``.

    Classes that never occur score 0 in these means, as in the official evaluators. The same names with ``_present``
    appended are means over the classes that occur in the truth (IoU: that have points; the others: that have segments
    which count), which suits small samples. A mean over no class is NaN.
    """
    figures = class_figures(statistics)
    thing = torch.zeros_like(statistics.tp, dtype=torch.bool)
    thing[list(things)] = True
    named = torch.ones_like(thing)
    named[0] = False
    with_segments, with_points = statistics.tp + statistics.fn > 0, statistics.confusion.sum(0) > 0
    columns = {
        "pq": (figures.pq, with_segments),
        "sq": (figures.sq, with_segments),
        "rq": (figures.rq, with_segments),
        "miou": (figures.iou, with_points),
    }
    means = {"pq_dagger": mean(torch.where(thing, figures.pq, figures.iou)[named])}
    for name, (values, present) in columns.items():
        for part, group in {"": named, "_things": thing, "_stuff": named & ~thing}.items():
            means[name + part] = mean(values[group])
            means[f"{name}{part}_present"] = mean(values[group & present])
    return means


def per_class(statistics: PanopticStatistics, class_names: Sequence[str]) -> dict[str, dict[str, float]]:
    """``{name: {pq, sq, rq, iou, tp, fp, fn}}`` of every class but void, in the order of the ids."""
    figures, rows = class_figures(statistics), {}
    for index, name in enumerate(class_names[1:], start=1):
        row = {field.name: float(getattr(figures, field.name)[index]) for field in fields(figures)}
        rows[name] = row | {key: int(getattr(statistics, key)[index]) for key in ("tp", "fp", "fn")}
    return rows
