"""PTQ, TQ and PAT, and MOTSA beside them, as the nuScenes evaluator forms them from counted scans.

For a class, with the sums of panoptic quality and the switches of its instances from one scan to the next (things):

    PTQ = (sum of IoU - switches) / (TP + FP / 2 + FN / 2)     sPTQ: switches weighted with IoU

For a track of n scans, of which k_p matched label p, which was also predicted in F_p scans without a match:

    AQ = 1/n sum over p of k_p^2 / (n + F_p)     IS = 1 - changes of label / (n - 1)     TQ = mean of sqrt(AQ IS)
    PAT = 2 PQ TQ / (PQ + TQ)

The official F_p takes matches off the scans in which p has enough points, though it matched also where it has less:
F_p may be negative, and AQ and TQ exceed 1. Its figures keep their names; ``tq_repaired`` and ``pat_repaired`` count p
in a scan where it has enough points or is matched, and take PAT as 0 where PQ and TQ are. Without any track the
evaluator stops with an error; here TQ and PAT are NaN.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from most.metrics.means import mean
from most.metrics.panoptic import EPS, class_figures
from most.metrics.tables import find_rows, sum_rows
from most.metrics.tracking import TrackingStatistics


@dataclass
class TrackQualities:
    """The quality of each track of the truth."""

    sequences: Int64[np.ndarray, "tracks"]
    classes: Int64[np.ndarray, "tracks"]
    official: Float64[np.ndarray, "tracks"]
    repaired: Float64[np.ndarray, "tracks"]


@dataclass
class ClassTracking:
    """The figures of each class; of void and stuff, PTQ and sPTQ are PQ."""

    ptq: Float64[Tensor, "classes"]
    sptq: Float64[Tensor, "classes"]
    motsa: Float64[Tensor, "classes"]
    smotsa: Float64[Tensor, "classes"]
    motsp: Float64[Tensor, "classes"]


def track_qualities(statistics: TrackingStatistics) -> TrackQualities:
    """TQ of each track, ascending by sequence, class and key."""
    tracks, hits = sum_rows(statistics.tracks, 3), sum_rows(statistics.hits, 4)
    predictions = sum_rows(statistics.predictions, 2)
    track_of, scans = find_rows(tracks[:, :3], hits[:, :3]), hits[:, 4]
    enough, counted = predictions[find_rows(predictions[:, :2], hits[:, [0, 3]])][:, 2:].T
    length, changes = tracks[:, 3], tracks[:, 4]
    steady = 1 - changes / np.maximum(length - 1, 1)

    def quality(elsewhere: Int64[np.ndarray, "hits"]) -> Float64[np.ndarray, "tracks"]:
        association = np.bincount(track_of, scans**2 / (length[track_of] + elsewhere), len(tracks)) / length
        return np.sqrt(association * steady)

    official, repaired = quality(np.where(enough > 0, enough - scans, 0)), quality(counted - scans)
    return TrackQualities(tracks[:, 0], tracks[:, 1], official, repaired)


def class_tracking(statistics: TrackingStatistics) -> ClassTracking:
    """PTQ and MOTSA of each class."""
    counts = statistics.panoptic
    tp, iou_sum, switches = counts.tp.double(), counts.iou_sum, statistics.switches.double()
    matched, segments = tp.clamp(min=EPS), (tp + counts.fp / 2 + counts.fn / 2).clamp(min=EPS)
    true = matched + counts.fn
    return ClassTracking(
        ptq=(iou_sum - switches) / matched * tp / segments,
        sptq=(iou_sum - statistics.soft_switches) / matched * tp / segments,
        motsa=(tp - counts.fp - switches) / true,
        smotsa=(iou_sum - counts.fp - switches) / true,
        motsp=iou_sum / matched,
    )


def tracking_figures(statistics: TrackingStatistics, things: Sequence[int]) -> dict[str, float]:
    """``pat pq tq ptq sptq ptq_dagger motsa smotsa motsp``, ``tq_repaired pat_repaired``.

    ``pq`` is the mean over all classes but void, absent ones as 0; ``tq`` over all tracks of things; the others over
    the classes that have segments in the truth (MOTSA and its like: things), but ``ptq_dagger``, over all classes:
    PTQ of things and the IoU of stuff. A mean over nothing is NaN.
    """
    panoptic, tracking = class_figures(statistics.panoptic), class_tracking(statistics)
    thing = torch.zeros_like(statistics.switches, dtype=torch.bool)
    thing[list(things)] = True
    named = torch.ones_like(thing)
    named[0] = False
    present = named & (statistics.panoptic.tp + statistics.panoptic.fn > 0)
    pq = mean(panoptic.pq[named])
    qualities = track_qualities(statistics)
    tq, tq_repaired = (mean(values) for values in (qualities.official, qualities.repaired))
    return {
        "pat": _harmonic(pq, tq),
        "pq": pq,
        "tq": tq,
        "ptq": mean(tracking.ptq[present]),
        "sptq": mean(tracking.sptq[present]),
        "ptq_dagger": mean(torch.where(thing, tracking.ptq, panoptic.iou)[named]),
        "motsa": mean(tracking.motsa[present & thing]),
        "smotsa": mean(tracking.smotsa[present & thing]),
        "motsp": mean(tracking.motsp[present & thing]),
        "tq_repaired": tq_repaired,
        "pat_repaired": 0.0 if pq == tq_repaired == 0 else _harmonic(pq, tq_repaired),
    }


def tracking_per_class(statistics: TrackingStatistics, class_names: Sequence[str]) -> dict[str, dict[str, float]]:
    """``{name: {ptq, sptq, tq, tracks, switches, soft_switches}}`` of every class but void, in the order of the ids.

    ``tq`` is the mean over the tracks of the class, NaN without one.
    """
    tracking, qualities = class_tracking(statistics), track_qualities(statistics)
    return {
        name: {
            "ptq": float(tracking.ptq[index]),
            "sptq": float(tracking.sptq[index]),
            "tq": mean(qualities.official[qualities.classes == index]),
            "tracks": int((qualities.classes == index).sum()),
            "switches": int(statistics.switches[index]),
            "soft_switches": float(statistics.soft_switches[index]),
        }
        for index, name in enumerate(class_names[1:], start=1)
    }


def _harmonic(one: float, other: float) -> float:
    """The harmonic mean; NaN for 0 and 0."""
    return 2 * one * other / (one + other) if one + other else float("nan")
