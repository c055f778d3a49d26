"""Membership accuracy: are the points in a centre's region of interest (RoI) given to the right centre (Table II)?

The paper calls it "the percentage of points within a given RoI that have been assigned to the correct center". We
count, for every detection matched to an instance of the truth, the points in its RoI that are predicted as its class
and whose truth is known; one is right if *it was assigned to this detection* agrees with *it is of the matched
instance*. Most such points lie in one RoI alone and are easy; the contested form counts only points that lie in the
RoIs of two or more matched detections of their class.
"""

from dataclasses import astuple, dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from most.geometry.boxes import along
from most.membership.matching import match_detections
from most.metrics.means import ratio
from most.structures import Detections, Instances

CHUNK = 2**20  # pairs of points and detections compared at once: some 30 MB


@dataclass
class MembershipCounts:
    """Pairs of points and detections, summed over scans."""

    correct: int = 0
    total: int = 0
    contested_correct: int = 0
    contested_total: int = 0

    def __add__(self, other: "MembershipCounts") -> "MembershipCounts":
        return MembershipCounts(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    def accuracies(self) -> dict[str, float]:
        """``membership_accuracy`` and ``membership_accuracy_contested``, in [0, 1]; NaN where nothing was counted."""
        return {
            "membership_accuracy": ratio(self.correct, self.total),
            "membership_accuracy_contested": ratio(self.contested_correct, self.contested_total),
        }


def membership_counts(
    points: Float[Tensor, "points 3"],
    semantics: Int64[Tensor, "points"],
    truth_semantics: Int64[Tensor, "points"],
    truth_labels: Int64[Tensor, "points"],
    detections: Detections,
    roi: Float[Tensor, "detections 3"],
    assigned: Int64[Tensor, "points"],
    truth: Instances,
) -> MembershipCounts:
    """Score one sweep's memberships; points, detections and ``truth`` share a frame (m).

    ``roi`` are half-sizes of the regions, which are turned as their detections are.
    ``semantics`` is predicted; ``assigned`` is the index of the detection that a point was given to after overlaps
    were resolved, -1 for none. ``truth`` holds all instances of the sweep, and its keys are ``truth_labels``: a point
    of a detection's class without an instance could be of any, so it is left out like void.
    """
    matches = match_detections(detections, roi, truth)
    counts = MembershipCounts()
    for thing in detections.classes[matches >= 0].unique().tolist():
        owners = ((matches >= 0) & (detections.classes == thing)).nonzero().squeeze(1)
        anyones = (truth_semantics == thing) & ~torch.isin(truth_labels, truth.keys)
        candidates = ((semantics == thing) & (truth_semantics != 0) & ~anyones).nonzero().squeeze(1)
        centres, keys = detections.centres[owners], truth.keys[matches[owners]]
        yaws = None if detections.yaws is None else detections.yaws[owners]
        for some in candidates.split(max(1, CHUNK // len(owners))):
            inside = (along(points[some][:, None] - centres, yaws).abs() < roi[owners]).all(2)
            right = inside & ((assigned[some][:, None] == owners) == (truth_labels[some][:, None] == keys))
            contested = inside.sum(1) > 1
            numbers = (right, inside, right[contested], inside[contested])
            counts += MembershipCounts(*(int(number.sum()) for number in numbers))
    return counts
