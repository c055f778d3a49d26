"""Panoptic quality as the benchmarks' official evaluators define it, in one pass over a scan (paper, Tables I to IV).

A segment is a (class, key) pair, where the key is the *whole* raw label: labels of one class may differ in more than
the instance id, and the official evaluators tell segments apart by all of it. Stuff is keyed like things. Points whose
truth is void count for nothing; segments of one class that overlap by more than half match (a true positive);
unmatched segments count only from ``min_points`` points on. Figures are fractions in [0, 1], in float64.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float64, Int64
from numpy.typing import NDArray
from torch import Tensor

from most.metrics.renumber import Integers, renumber

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
    columns = (pred_semantics, pred_keys, truth_semantics, truth_keys)
    (pred_sem, pred_key, truth_sem, truth_key), length = _runs([column.cpu().numpy() for column in columns])
    confusion = _totals(pred_sem * num_classes + truth_sem, length, num_classes**2)

    known = truth_sem != 0
    length = length[known]
    pred = _Segments.find(pred_sem[known], pred_key[known], length, num_classes)
    truth = _Segments.find(truth_sem[known], truth_key[known], length, num_classes)
    match_pred, match_truth, iou = _matches(pred, truth, length)

    false = (pred.areas >= min_points) & (pred.classes != 0)
    missed = truth.areas >= min_points
    false[match_pred] = False
    missed[match_truth] = False
    match_class = truth.classes[match_truth]
    return PanopticStatistics(
        confusion=torch.from_numpy(confusion).long().view(num_classes, num_classes),
        iou_sum=torch.from_numpy(_totals(match_class, iou, num_classes)),
        tp=torch.from_numpy(np.bincount(match_class, minlength=num_classes)),
        fp=torch.from_numpy(np.bincount(pred.classes[false], minlength=num_classes)),
        fn=torch.from_numpy(np.bincount(truth.classes[missed], minlength=num_classes)),
    )


def _runs(columns: list[Integers]) -> tuple[list[Integers], Integers]:
    """Merge neighbours that agree in every column, and count them: along a beam most do, so little work is left."""
    count = len(columns[0])
    starts = np.zeros(count, dtype=bool)
    starts[:1] = True
    for column in columns:
        starts[1:] |= column[1:] != column[:-1]
    first = np.flatnonzero(starts)
    return [column[first] for column in columns], np.diff(first, append=count)


class _Segments(NamedTuple):
    """The segments of one labelling of a scan: the (class, key) pairs that occur."""

    classes: Integers
    areas: NDArray[np.float64]  # points
    of_run: Integers  # each run's segment

    @classmethod
    def find(cls, semantics: Integers, keys: Integers, length: Integers, num_classes: int) -> "_Segments":
        """Number the pairs of class and key."""
        codes, of_run = renumber(renumber(keys)[1] * num_classes + semantics)
        return cls(codes % num_classes, _totals(of_run, length, len(codes)), of_run)


def _matches(pred: _Segments, truth: _Segments, length: Integers) -> tuple[Integers, Integers, NDArray[np.float64]]:
    """Predicted segment, true segment and IoU of each match; above one half no segment can have two."""
    count = max(len(pred.classes), 1)
    pairs, pair = renumber(truth.of_run * count + pred.of_run)
    pair_truth, pair_pred = np.divmod(pairs, count)
    overlap = _totals(pair, length, len(pairs))
    iou = overlap / (truth.areas[pair_truth] + pred.areas[pair_pred] - overlap)
    matched = (truth.classes[pair_truth] == pred.classes[pair_pred]) & (iou > 0.5)
    return pair_pred[matched], pair_truth[matched], iou[matched]


def _totals(index: Integers, amounts: NDArray[Any], size: int) -> NDArray[np.float64]:
    """Sum the amounts that fall on each of ``size`` indices; exact for counts of points."""
    return np.bincount(index, weights=amounts, minlength=size).astype(np.float64)  # it gives integers for no items


def class_figures(statistics: PanopticStatistics) -> ClassFigures:
    """PQ = SQ RQ of each class, and its IoU over points, where a known point predicted void is a miss."""
    tp = statistics.tp.double()
    sq = statistics.iou_sum / tp.clamp(min=EPS)
    rq = tp / (tp + statistics.fp / 2 + statistics.fn / 2).clamp(min=EPS)
    confusion = statistics.confusion.double()
    confusion[:, 0] = 0
    hits = confusion.diagonal()
    union = confusion.sum(0) + confusion.sum(1) - hits
    return ClassFigures(sq * rq, sq, rq, hits / union.clamp(min=EPS))


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
    means = {"pq_dagger": _mean(torch.where(thing, figures.pq, figures.iou), named)}
    for name, (values, present) in columns.items():
        for part, group in {"": named, "_things": thing, "_stuff": named & ~thing}.items():
            means[name + part] = _mean(values, group)
            means[f"{name}{part}_present"] = _mean(values, group & present)
    return means


def _mean(values: Float64[Tensor, "classes"], group: Bool[Tensor, "classes"]) -> float:
    return float(values[group].mean())


def per_class(statistics: PanopticStatistics, class_names: Sequence[str]) -> dict[str, dict[str, float]]:
    """``{name: {pq, sq, rq, iou, tp, fp, fn}}`` of every class but void, in the order of the ids."""
    figures, rows = class_figures(statistics), {}
    for index, name in enumerate(class_names[1:], start=1):
        row = {field.name: float(getattr(figures, field.name)[index]) for field in fields(figures)}
        rows[name] = row | {key: int(getattr(statistics, key)[index]) for key in ("tp", "fp", "fn")}
    return rows
