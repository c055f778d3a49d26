"""Memberships that rate pairs of points and detected centres (paper, inference paragraph; Algorithm 1)."""

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from most.membership.claims import Claims
from most.membership.evidence import Evidence
from most.membership.roi import Pairs, RegionOfInterest

MEMBER = 0.5  # a pair belongs together above this confidence (Algorithm 1, line 10)


class Rating:
    """Calling it rates pairs; a point is claimed by the centre of its best pair."""

    def __call__(self, evidence: Evidence, pairs: Pairs) -> Float[Tensor, "pairs"]:
        """Return each pair's confidence in [0, 1]."""
        raise NotImplementedError

    def claim(self, evidence: Evidence, roi: RegionOfInterest, overlap: str) -> Claims:
        """Let the detected centres claim the points in their regions (see :class:`most.membership.Membership`).

        A detection's points keep their predicted class, which is the detection's own: points of another class are never
        its members (Algorithm 1, line 7, prints this the wrong way round).

        Whether it belongs to a centre is the question for a point in one region; in several it is to which of them, and
        the most confident has it however low its confidence, unless that is 0.
        """
        pairs = roi.pairs(evidence.points, evidence.semantics, evidence.detections)
        confidence = self(evidence, pairs)
        members = confidence > MEMBER
        if overlap == "confident":
            regions = torch.bincount(pairs.points, minlength=len(evidence.points))
            members |= (regions[pairs.points] > 1) & (confidence > 0)
        rank = confidence if overlap == "confident" else -pairs.detections.to(confidence.dtype)
        return Claims(evidence.detections, best(len(evidence.points), pairs.select(members), rank[members]))


def best(count: int, pairs: Pairs, rank: Float[Tensor, "pairs"]) -> Int64[Tensor, "points"]:
    """Return for each point the detection of its highest-ranked pair (the first of equals), -1 where it has none."""
    order = torch.argsort(rank, descending=True, stable=True)
    chosen = torch.full((count,), -1, dtype=torch.long, device=rank.device)
    taken, first = np.unique(pairs.points[order].cpu().numpy(), return_index=True)
    winners = order[torch.as_tensor(first, device=rank.device)]
    chosen[torch.as_tensor(taken, device=rank.device)] = pairs.detections[winners]
    return chosen
