"""What a scan adds to the nuScenes tracking metrics, given the scans of its sequence before it, in order.

Two notions of a match stand beside each other. PTQ takes the true positives of panoptic quality and asks whether an
instance kept its predicted key from one scan to the next. TQ matches instances with predicted keys of any class, and
follows every instance as a track over the whole sequence.
"""

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from most.metrics.overlaps import Overlaps, among
from most.metrics.panoptic import PanopticStatistics, panoptic_statistics_of, true_positives
from most.metrics.tables import table

Track = tuple[int, int]  # class and key of an instance of the truth
UNMATCHED = 0  # the label void, which matches nothing


@dataclass(frozen=True)
class TrackingRules:
    """What is followed."""

    num_classes: int  # void included
    things: tuple[int, ...]
    min_points: int  # unmatched segments count from this many points on, instances are followed where they have more


@dataclass
class TrackMemory:
    """What the next scan of a sequence has to know of those before; a sequence starts with an empty one."""

    labels: dict[Track, int] = field(default_factory=dict)  # each track's label in the last scan where it counted
    matches: dict[Track, tuple[int, float]] = field(default_factory=dict)  # the last scan's: predicted key, IoU


@dataclass
class TrackingStatistics:
    """Counted in a scan, or in many; the tables may hold several rows of a key, which mean their sum."""

    panoptic: PanopticStatistics
    switches: Int64[Tensor, "classes"]  # true positives whose predicted key is not that of the scan before
    soft_switches: Float64[Tensor, "classes"]  # the same weighted with IoU
    tracks: Int64[np.ndarray, "tracks 5"]  # sequence, class, key, scans, changes of label from scan to scan
    hits: Int64[np.ndarray, "hits 5"]  # sequence, class, key, label, scans in which the track was matched with it
    predictions: Int64[np.ndarray, "predictions 4"]  # sequence, label, scans with enough points, those or matched


def tracking_statistics(
    overlaps: Overlaps, sequence: int, memory: TrackMemory, rules: TrackingRules
) -> tuple[TrackingStatistics, TrackMemory]:
    """Count one scan; return the counts, and what the next scan of the sequence has to know.

    The keys of ``overlaps`` are whole labels; ``sequence`` numbers the sequence. Points of void truth count nowhere.
    """
    known = overlaps.known
    matches = thing_matches(known, rules.things)
    switches, soft_switches = _switches(memory.matches, matches, rules.num_classes)

    regardless = known.by_predicted_key()
    labels = _labels(regardless, rules)
    tracks = np.array([[*track, _changed(memory.labels, track, label)] for track, label in labels.items()])
    tracks = tracks.reshape(-1, 3).astype(np.int64)
    hits = [[*track, label, 1] for track, label in labels.items() if label != UNMATCHED]
    statistics = TrackingStatistics(
        panoptic=panoptic_statistics_of(overlaps, rules.num_classes, rules.min_points),
        switches=switches,
        soft_switches=soft_switches,
        tracks=table(sequence, tracks[:, 0], tracks[:, 1], 1, tracks[:, 2]),
        hits=table(sequence, *np.array(hits, dtype=np.int64).reshape(-1, 4).T),
        predictions=_prediction_rows(regardless, sequence, labels, rules),
    )
    return statistics, TrackMemory(memory.labels | labels, matches)


def thing_matches(known: Overlaps, things: Collection[int]) -> dict[Track, tuple[int, float]]:
    """The true positives of things, by instance: predicted key and IoU. ``known`` has no points of void truth."""
    match = true_positives(known)
    match = match.where(among(known.truth.classes[match.truth], things))
    classes, keys = known.truth.classes[match.truth].tolist(), known.truth.keys[match.truth].tolist()
    found = zip(known.pred.keys[match.pred].tolist(), match.iou.tolist(), strict=True)
    return dict(zip(zip(classes, keys, strict=True), found, strict=True))


def _switches(
    before: dict[Track, tuple[int, float]], now: dict[Track, tuple[int, float]], num_classes: int
) -> tuple[Int64[Tensor, "classes"], Float64[Tensor, "classes"]]:
    """Instances found in both scans, but under different keys: how many of each class, and their IoUs now."""
    switches, soft_switches = np.zeros(num_classes, dtype=np.int64), np.zeros(num_classes)
    for track, (key, iou) in now.items():
        if track in before and before[track][0] != key:
            switches[track[0]] += 1
            soft_switches[track[0]] += iou
    return torch.from_numpy(switches), torch.from_numpy(soft_switches)


def _labels(regardless: Overlaps, rules: TrackingRules) -> dict[Track, int]:
    """The label that every instance with enough points is matched with, whatever its class."""
    match = regardless.matches_above_half
    label_of = np.full(len(regardless.truth.keys), UNMATCHED)
    label_of[match.truth] = regardless.pred.keys[match.pred]
    followed = among(regardless.truth.classes, rules.things) & (regardless.truth_areas > rules.min_points)
    classes, keys = regardless.truth.classes[followed].tolist(), regardless.truth.keys[followed].tolist()
    return dict(zip(zip(classes, keys, strict=True), label_of[followed].tolist(), strict=True))


def _changed(before: dict[Track, int], track: Track, label: int) -> bool:
    """Whether a track changes its label, or had none: a miss after a miss counts as well."""
    return track in before and (before[track] != label or before[track] == UNMATCHED)


def _prediction_rows(
    regardless: Overlaps, sequence: int, labels: dict[Track, int], rules: TrackingRules
) -> Int64[np.ndarray, "predictions 4"]:
    keys = regardless.pred.keys
    enough = regardless.pred_areas > rules.min_points
    matched = set(labels.values()) - {UNMATCHED}
    counts = enough | np.array([key in matched for key in keys.tolist()], dtype=bool)
    return table(sequence, keys[counts], enough[counts].astype(np.int64), 1)
