"""What every membership gives: detections, and the points that each claims."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from jaxtyping import Int64
from torch import Tensor

from most.membership.evidence import Evidence
from most.membership.roi import RegionOfInterest
from most.structures import Detections, OnDevice


@dataclass
class Claims(OnDevice):
    """The instances found in one sweep."""

    detections: Detections  # the evidence's own, or those that a clustering makes of its clusters
    claimed: Int64[Tensor, "points"]  # index of the detection whose member the point is, -1 for none


@runtime_checkable
class Membership(Protocol):
    """Whatever says which points are an instance (Table II): by rating pairs, or by clustering points."""

    def claim(self, evidence: Evidence, roi: RegionOfInterest, overlap: str) -> Claims:
        """Return the instances of one sweep.

        ``roi`` and ``overlap`` (``Fusion.overlap``) concern those that ask which of several centres a point belongs to.
        """
        ...
