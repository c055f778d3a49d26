"""What all figures of a split are made of, summed by held-out sequence: the section ``sums`` of ``metrics.json``.

    {"evaluator": whose rules, "classes": [names by training id, void first], "things": [ids], "min_points": theirs,
     "distance_edges": [m], "points_edges": [points],     where bins begin; the last one has no end
     "visible_edges": [share],                            the last one ends at 1
     "sequences": {NAME: {
        "scans": 3,
        "tp" "fp" "fn" "iou": [by class]                  segments, and the sum of the matches' IoU: PQ, SQ, RQ
        "intersection" "predicted" "true": [by class]     points of known truth; union = predicted + true - intersection
        "membership": [correct, total, contested correct, contested total] or null
        "distance": {"tp" "fp" "fn" "iou": [by bin [by class]]} or null       things alone, the official ones
        "points": the same                                                   all things, those too small included
        "visible": the same or null                       objects, by how much of them is seen: see metrics.sightings
        "assoc" "tubes": [by class]                       of most.evaluate alone: S_assoc = all assoc / things' tubes
        "switches": [by class], "tq": [their sum, tracks] of most.evaluate on nuScenes alone: PTQ and PAT
     }}}

Reports of earlier versions have no "visible", "switches" and "tq", and can be read all the same.
Everything adds up over scans, sequences and processes; figures are formed of sums of whatever sequences one likes.
"""

from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.metrics.membership import MembershipCounts
from most.metrics.overlaps import among, find_overlaps
from most.metrics.panoptic import (
    Outcomes,
    PanopticStatistics,
    PointCounts,
    confusion_of,
    outcomes,
    panoptic_figures,
    per_class,
)
from most.metrics.places import Places
from most.metrics.segment_sums import DISTANCES, POINTS, SegmentSums, by_distance, by_points
from most.metrics.sightings import VISIBLE, Sightings, by_visible
from most.processes import everyones


@dataclass
class SequenceSums:
    """The sums of one scan, of a sequence's, or of a split's."""

    scans: int
    confusion: Int64[Tensor, "classes classes"]  # points, indexed [predicted, truth], void included
    segments: SegmentSums  # in one bin
    distance: SegmentSums | None  # None where the places of the points were not given
    points: SegmentSums
    sightings: list[Sightings] | None  # of each scan; of one sequence alone can they be counted
    membership: MembershipCounts | None  # None where no detections were given

    @classmethod
    def zeros(cls, num_classes: int) -> "SequenceSums":
        """The sums of no scan at all; ``num_classes`` includes void."""
        segments, distance, points = (SegmentSums.zeros(bins, num_classes) for bins in (1, len(DISTANCES), len(POINTS)))
        confusion = torch.zeros(num_classes, num_classes, dtype=torch.int64)
        return cls(0, confusion, segments, distance, points, [], MembershipCounts())

    def __add__(self, other: "SequenceSums") -> "SequenceSums":
        pairs = {name: (value, getattr(other, name)) for name, value in vars(self).items()}
        sums: dict[str, Any] = {name: None if a is None or b is None else a + b for name, (a, b) in pairs.items()}
        return SequenceSums(**sums)

    def statistics(self) -> PanopticStatistics:
        """What the panoptic figures are formed of."""
        counts = (torch.from_numpy(getattr(self.segments, name)[0]) for name in ("tp", "fp", "fn"))
        return PanopticStatistics(self.confusion, torch.from_numpy(self.segments.iou.sum(0)[0]), *counts)

    def plain(self) -> dict[str, Any]:
        """Return it as the section ``sums`` has it."""
        points = PointCounts.of(self.confusion)
        return {
            "scans": self.scans,
            **{name: bins[0] for name, bins in self.segments.plain().items()},
            "intersection": points.hits.long().tolist(),
            "predicted": points.predicted.long().tolist(),
            "true": points.true.long().tolist(),
            "membership": None if self.membership is None else list(astuple(self.membership)),
            "distance": None if self.distance is None else self.distance.plain(),
            "points": self.points.plain(),
            "visible": None if self.sightings is None else by_visible(self.sightings, len(self.confusion)).plain(),
        }


class SplitSums:
    """Sums by sequence; scans may come in any order, and be shared by processes in any way."""

    def __init__(self, taxonomy: Taxonomy) -> None:
        self.taxonomy = taxonomy
        self.sequences: dict[str, SequenceSums] = {}

    def update(
        self,
        sequence: str,
        pred: tuple[Int64[Tensor, "points"], Int64[Tensor, "points"]],
        truth: tuple[Int64[Tensor, "points"], Int64[Tensor, "points"]],
        points: Float[Tensor, "points 3"] | None = None,
        membership: MembershipCounts | None = None,
    ) -> None:
        """Add a scan: classes and whole raw labels as predicted and as they are, points in the sensor frame (m)."""
        overlaps = find_overlaps(*pred, *truth)
        size, things = self.taxonomy.num_classes, self.taxonomy.things
        official = outcomes(overlaps, self.taxonomy.min_points)
        everywhere = np.zeros(max(len(overlaps.pred.keys), len(overlaps.truth.keys)), dtype=np.int64)
        places = None if points is None else Places.of(points, overlaps, pred, truth, things)
        scan = SequenceSums(
            scans=1,
            confusion=confusion_of(overlaps, size),
            segments=SegmentSums.of(official, everywhere, everywhere, 1, size),
            distance=None if places is None else by_distance(official, places, size, things),
            points=by_points(outcomes(overlaps, 1), size, things),
            sightings=None if places is None else [self._sightings(official, places)],
            membership=membership,
        )
        self._add(sequence, scan)

    def _sightings(self, official: Outcomes, places: Places) -> Sightings:
        truth, things = official.overlaps.truth, self.taxonomy.things
        objects = among(truth.classes, things) & (self.taxonomy.instance_of(torch.from_numpy(truth.keys)).numpy() != 0)
        return Sightings.of(official, places.lengths, objects, things)

    def of_all_processes(self) -> "SplitSums":
        """Return the sums of what all processes saw; each of them has to call it."""
        joined = SplitSums(self.taxonomy)
        for sequence, sums in everyones(sorted(self.sequences.items())):
            joined._add(sequence, sums)
        return joined

    def together(self) -> SequenceSums:
        """Return the sums over all sequences."""
        return sum(self.sequences.values(), SequenceSums.zeros(self.taxonomy.num_classes))

    def figures(self) -> dict[str, Any]:
        """Return the panoptic figures, those of each class, and the membership accuracies (None where unknown)."""
        whole = self.together()
        statistics, unknown = whole.statistics(), dict.fromkeys(MembershipCounts().accuracies())
        return {
            **panoptic_figures(statistics, self.taxonomy.things),
            **(unknown if whole.membership is None else whole.membership.accuracies()),
            "per_class": per_class(statistics, self.taxonomy.class_names),
        }

    def plain(self) -> dict[str, Any]:
        """Return the section ``sums``, sequences by name."""
        return {
            "evaluator": self.taxonomy.evaluator,
            "classes": list(self.taxonomy.class_names),
            "things": list(self.taxonomy.things),
            "min_points": self.taxonomy.min_points,
            "distance_edges": list(DISTANCES),
            "points_edges": list(POINTS),
            "visible_edges": list(VISIBLE),
            "sequences": {name: self.sequences[name].plain() for name in sorted(self.sequences)},
        }

    def _add(self, sequence: str, scan: SequenceSums) -> None:
        known = self.sequences.get(sequence)
        self.sequences[sequence] = scan if known is None else known + scan
