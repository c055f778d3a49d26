"""Tubes: instances followed through a sequence, as sets of points in space and time, for LSTQ.

LSTQ is defined in "4D Panoptic LiDAR Segmentation" (Aygün et al., 2021), but its two official evaluators differ in
what they count; :class:`TubeRules` holds the differences. Counts of points are exact and add up over scans and
sequences in any order.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int64
from torch import Tensor

from most.metrics.overlaps import Overlaps, among, totals
from most.metrics.panoptic import confusion_of
from most.metrics.renumber import Integers, renumber
from most.metrics.tables import table


@dataclass(frozen=True)
class TubeRules:
    """Which points of a scan belong to tubes."""

    truth_classes: tuple[int, ...]  # whose instances are true tubes
    pred_classes: tuple[int, ...]  # whose points count for the size of a predicted tube
    min_points: int  # a true tube grows only in scans where it has more points than this
    pred_min_points: int  # and a predicted tube
    zero_is_an_instance: bool  # of the truth or the prediction

    @classmethod
    def semantickitti(cls, num_classes: int, min_points: int) -> "TubeRules":
        """Ids are the upper 16 bits of a label, 0 is none; predicted tubes have no least size, and any class."""
        named = tuple(range(1, num_classes))
        return cls(named, named, min_points, pred_min_points=0, zero_is_an_instance=False)

    @classmethod
    def nuscenes(cls, things: Sequence[int], min_points: int) -> "TubeRules":
        """Ids are whole labels, and tubes are things, by truth as by prediction."""
        return cls(tuple(things), tuple(things), min_points, pred_min_points=min_points, zero_is_an_instance=True)


@dataclass
class TubeStatistics:
    """Points counted in a scan, or in many."""

    confusion: Int64[Tensor, "classes classes"]  # indexed [predicted, truth], void included
    truth: Int64[np.ndarray, "truth 4"]  # sequence, class, id, points
    pred: Int64[np.ndarray, "pred 4"]  # sequence, id, points, those that no true tube is too small for in their scan
    overlaps: Int64[np.ndarray, "pairs 6"]  # sequence, class, true id, predicted id, points, those in the pred's size


def tube_statistics(overlaps: Overlaps, sequence: int, rules: TubeRules, num_classes: int) -> TubeStatistics:
    """Count the points of one scan; the keys of ``overlaps`` are instance ids, as ``rules`` takes them.

    ``sequence`` numbers the sequence: tubes of different sequences are never the same. A predicted tube is an id,
    whatever its classes; a true one is a class and an id. The official evaluators count all points that a true tube
    shares with an id, but for the size of the id only those predicted as certain classes (and, for nuScenes, where
    they are enough in the scan), so that a tube may share more than it has: ``overlaps`` has both counts. They count
    points for that size whose true tube is too small in the scan to grow by them: ``pred`` has both counts.
    """
    known = overlaps.known
    truth = known.truth
    instances = among(truth.classes, rules.truth_classes) & _is_instance(truth.keys, rules)
    tubes = instances & (known.truth_areas > rules.min_points)

    ids, id_of_segment = renumber(known.pred.keys)
    id_of = id_of_segment[known.pred_of]
    counted = np.where(among(known.pred.classes, rules.pred_classes)[known.pred_of], known.points, 0)
    sizes = totals(id_of, counted, len(ids))
    fair = totals(id_of, np.where((instances & ~tubes)[known.truth_of], 0, counted), len(ids))
    seen = _is_instance(ids, rules) & (sizes > rules.pred_min_points)

    shared = tubes[known.truth_of] & _is_instance(ids, rules)[id_of]
    truth_of, id_of = known.truth_of[shared], id_of[shared]
    points, of_size = known.points[shared], np.where(seen[id_of], counted[shared], 0)
    return TubeStatistics(
        confusion=confusion_of(overlaps, num_classes),
        truth=table(sequence, truth.classes[tubes], truth.keys[tubes], known.truth_areas[tubes]),
        pred=table(sequence, ids[seen], sizes[seen], fair[seen]),
        overlaps=table(sequence, truth.classes[truth_of], truth.keys[truth_of], ids[id_of], points, of_size),
    )


def _is_instance(ids: Integers, rules: TubeRules) -> Bool[np.ndarray, "segments"]:
    return (ids != 0) | rules.zero_is_an_instance
