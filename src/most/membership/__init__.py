"""Membership: which points, of those in a centre's region of interest, belong to it (paper, Eq. 3 and Table II)."""

from most.membership.nearest import Nearest
from most.membership.roi import Pairs, RegionOfInterest

__all__ = ["Nearest", "Pairs", "RegionOfInterest"]
