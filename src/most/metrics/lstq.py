"""LSTQ, the lidar segmentation and tracking quality, as either official evaluator forms it from counted tubes.

    S_assoc = sum over true tubes g of (1 / |g|) sum over predicted tubes p of |p & g| IoU(p, g), by the number of g
    S_cls   = mean IoU of classes over points
    LSTQ    = sqrt(S_assoc S_cls)

The official S_assoc may exceed 1: a tube may share more points than its size says, and SemanticKITTI's sums over
tubes of stuff too, but divides by those of things alone. Nor does it give 1 to the truth itself: in scans where a
true tube has too few points to count, they count for the predicted one. Its figures keep their names; beside them
stand those with ``_repaired``, which count what is shared as sizes are counted, things alone, and such points on
neither side. Without a tube both are NaN.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from most.metrics.means import mean, ratio
from most.metrics.panoptic import EPS, PointCounts
from most.metrics.tables import find_rows, sum_rows
from most.metrics.tubes import TubeStatistics


class Columns(NamedTuple):
    """Which counts are compared."""

    shared: int  # of the overlaps
    sizes: int  # of the predicted tubes


OFFICIAL = Columns(shared=4, sizes=2)  # all shared points; all points of the predicted tube
REPAIRED = Columns(shared=5, sizes=3)  # those that predicted sizes count; those that true tubes could count


@dataclass
class Association:
    """How well predicted tubes cover true ones."""

    tubes: Int64[np.ndarray, "classes"]  # true tubes
    sums: Float64[np.ndarray, "classes"]  # of their qualities
    precisions: Float64[np.ndarray, "pairs"]  # of each pair of tubes that share points: their share of the predicted
    recalls: Float64[np.ndarray, "pairs"]  # and of the true one

    def mean_over(self, things: Sequence[int]) -> float:
        """The sum over all classes by the number of ``things``: NaN, or infinite, where there is none."""
        return ratio(float(self.sums.sum()), int(self.tubes[list(things)].sum()))


def associate(statistics: TubeStatistics, columns: Columns = OFFICIAL) -> Association:
    """Compare predicted and true tubes by some of their counts."""
    truth, pred = sum_rows(statistics.truth, 3), sum_rows(statistics.pred, 2)
    overlaps = sum_rows(statistics.overlaps, 4)
    truth_of = find_rows(truth[:, :3], overlaps[:, :3])
    pred_of = find_rows(pred[:, :2], overlaps[:, [0, 3]])
    pairs = (pred_of >= 0) & (overlaps[:, columns.shared] > 0)
    truth_of, pred_of, shared = truth_of[pairs], pred_of[pairs], overlaps[pairs, columns.shared].astype(np.float64)
    true_size, pred_size = truth[truth_of, 3], pred[pred_of, columns.sizes]
    quality = shared * shared / (true_size + pred_size - shared) / true_size
    classes, of_pair, size = truth[:, 1], truth[truth_of, 1], len(statistics.confusion)
    return Association(
        tubes=np.bincount(classes, minlength=size),
        sums=np.bincount(of_pair, quality, size).astype(np.float64),
        precisions=shared / pred_size,
        recalls=shared / true_size,
    )


def lstq_semantickitti(statistics: TubeStatistics, things: Sequence[int]) -> dict[str, float]:
    """``lstq s_assoc s_cls aq_p aq_r iou_p iou_r iou_things iou_stuff`` and ``lstq s_assoc aq_p`` ``_repaired``.

    Here S_cls is the mean over the classes that occur in truth or prediction; a known point that is predicted void
    makes void one of them, with IoU 0. aq_p, aq_r: mean precision and recall of pairs of tubes that share points;
    iou_p, iou_r: mean precision and recall of classes over points.
    """
    counts = PointCounts.of(statistics.confusion)
    present = int((counts.union() > 0).sum())
    s_cls = ratio(float(counts.iou().sum()), present)
    official, repaired = associate(statistics), _repaired_association(statistics, things)
    stuff = [index for index in range(1, len(statistics.confusion)) if index not in things]
    return _lstq(official.mean_over(things), s_cls, repaired.mean_over(things)) | {
        "aq_p": mean(official.precisions),
        "aq_r": mean(official.recalls),
        "iou_p": ratio(float((counts.hits / counts.predicted.clamp(min=EPS)).sum()), present),
        "iou_r": ratio(float((counts.hits / counts.true.clamp(min=EPS)).sum()), present),
        "iou_things": float(counts.iou()[list(things)].mean()),
        "iou_stuff": float(counts.iou()[stuff].mean()),
        "aq_p_repaired": mean(repaired.precisions),
    }


def lstq_nuscenes(statistics: TubeStatistics, things: Sequence[int]) -> dict[str, float]:
    """``lstq s_assoc s_cls``, and ``lstq s_assoc`` ``_repaired``; S_cls is the mean IoU of all classes but void."""
    s_cls = float(PointCounts.of(statistics.confusion).iou()[1:].mean())
    return _lstq(
        associate(statistics).mean_over(things), s_cls, _repaired_association(statistics, things).mean_over(things)
    )


def lstq_per_class(statistics: TubeStatistics, class_names: Sequence[str]) -> dict[str, dict[str, float]]:
    """``{name: {assoc, assoc_sum, tubes, iou}}`` of every class but void, in the order of the ids, as official.

    ``assoc`` is the sum of the class's tubes by their number, 0 without one.
    """
    association, iou = associate(statistics), PointCounts.of(statistics.confusion).iou()
    return {
        name: {
            "assoc": float(association.sums[index] / max(association.tubes[index], EPS)),
            "assoc_sum": float(association.sums[index]),
            "tubes": int(association.tubes[index]),
            "iou": float(iou[index]),
        }
        for index, name in enumerate(class_names[1:], start=1)
    }


def associate_by_sequence(statistics: TubeStatistics) -> dict[int, Association]:
    """Compare the tubes of each sequence by themselves, as official: their sums and numbers add up."""
    found = {}
    for sequence in np.unique(np.concatenate([rows[:, 0] for rows in (statistics.truth, statistics.overlaps)])):
        rows = (table[table[:, 0] == sequence] for table in (statistics.truth, statistics.pred, statistics.overlaps))
        found[int(sequence)] = associate(TubeStatistics(statistics.confusion, *rows))
    return found


def _repaired_association(statistics: TubeStatistics, things: Sequence[int]) -> Association:
    """The association of true tubes of things alone, sharing points as sizes count them."""
    truth = statistics.truth[np.isin(statistics.truth[:, 1], list(things))]
    overlaps = statistics.overlaps[np.isin(statistics.overlaps[:, 1], list(things))]
    return associate(TubeStatistics(statistics.confusion, truth, statistics.pred, overlaps), REPAIRED)


def _lstq(s_assoc: float, s_cls: float, repaired: float) -> dict[str, float]:
    return {
        "lstq": float(np.sqrt(s_assoc * s_cls)),
        "s_assoc": s_assoc,
        "s_cls": s_cls,
        "lstq_repaired": float(np.sqrt(repaired * s_cls)),
        "s_assoc_repaired": repaired,
    }
