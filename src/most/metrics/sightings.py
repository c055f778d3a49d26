"""Segments of things counted by how much of the object is seen: PQ against occlusion.

How long an object's points reach over ground in a scan, as a share of the longest that they ever do in its sequence:
what an occluder, the object itself or the edge of view hides is missing there. It is also what shrink-wrapped extents
lack of the track's maximum (paper, section III). Points at hand tell it, of whatever dataset; an object that is never
seen whole counts as whole where most of it is seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import torch
from jaxtyping import Bool, Float64, Int64

from most.metrics.exact_sums import exact_parts
from most.metrics.overlaps import among
from most.metrics.panoptic import Outcomes
from most.metrics.segment_sums import SegmentSums

VISIBLE = (0.0, 0.2, 0.4, 0.6, 0.8)  # shares of an object's length, where bins begin; the last one ends at 1


@dataclass
class Sightings:
    """The objects of one scan, or of several of a sequence: how long each is there, and what became of it."""

    classes: Int64[np.ndarray, "objects"]
    keys: Int64[np.ndarray, "objects"]  # with its class, the same object in all scans of a sequence
    lengths: Float64[np.ndarray, "objects"]  # m, over ground
    tp: Int64[np.ndarray, "objects"]  # whether it was matched
    fp: Int64[np.ndarray, "objects"]  # false segments that have most of their points of it
    fn: Int64[np.ndarray, "objects"]  # whether it was missed
    iou: Float64[np.ndarray, "objects"]  # of the match, 0 without one

    @classmethod
    def of(
        cls,
        outcomes: Outcomes,
        lengths: Float64[np.ndarray, "true"],
        objects: Bool[np.ndarray, "true"],
        things: Sequence[int],
    ) -> "Sightings":
        """Take down one scan's outcomes; ``objects`` are the true segments that are an instance of a thing."""
        truth, count = outcomes.overlaps.truth, len(outcomes.overlaps.truth.keys)
        tp, fn, iou = (np.zeros(count, kind) for kind in (np.int64, np.int64, np.float64))
        tp[outcomes.match.truth], iou[outcomes.match.truth], fn[outcomes.missed] = 1, outcomes.match.iou, 1
        false = outcomes.false[among(outcomes.fp, things)]
        fp = np.bincount(_mostly(outcomes)[false], minlength=count)
        columns = (truth.classes, truth.keys, lengths, tp, fp, fn, iou)
        return cls(*(column[objects] for column in columns))


def by_visible(sightings: Sequence[Sightings], num_classes: int) -> SegmentSums:
    """Count the objects of one sequence by the share of them that is seen; false segments of none of them are left out.

    So are objects that are there once, with which nothing can be compared.
    """
    size = (len(VISIBLE), num_classes)
    if not sightings:
        return SegmentSums.zeros(*size)
    all_of = {name: np.concatenate([getattr(scan, name) for scan in sightings]) for name in _NAMES}
    pairs = np.stack([all_of["classes"], all_of["keys"]], 1)
    _, track, seen = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    track = track.reshape(-1)  # some releases of numpy keep an axis
    longest = np.zeros(len(seen))
    np.maximum.at(longest, track, all_of["lengths"])
    counted = np.flatnonzero((seen > 1)[track] & (longest > 0)[track])
    share = all_of["lengths"][counted] / longest[track[counted]]
    place = (np.searchsorted(VISIBLE, share, "right") - 1) * num_classes + all_of["classes"][counted]

    def count(amounts: Float64[np.ndarray, "counted"]) -> Float64[np.ndarray, "bins classes"]:
        return np.bincount(place, amounts, size[0] * size[1]).reshape(size).astype(np.float64)

    tp, fp, fn = (count(all_of[name][counted].astype(np.float64)).astype(np.int64) for name in ("tp", "fp", "fn"))
    parts = exact_parts(torch.from_numpy(all_of["iou"][counted])).numpy()
    return SegmentSums(tp, fp, fn, np.stack([count(part) for part in parts]))


_NAMES = [field.name for field in fields(Sightings)]


def _mostly(outcomes: Outcomes) -> Int64[np.ndarray, "predicted"]:
    """The true segment that has most of each predicted segment's known points; the first of several, 0 without any."""
    known = outcomes.overlaps
    order = np.lexsort((-known.truth_of, known.points, known.pred_of))  # the last of a segment's pairs is it
    found = np.zeros(len(known.pred.keys), dtype=np.int64)
    found[known.pred_of[order]] = known.truth_of[order]
    return found
