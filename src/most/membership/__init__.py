"""Membership: which points, of those in a centre's region of interest, belong to it (paper, Eq. 3 and Table II)."""

from most.membership.evidence import Channels, Evidence
from most.membership.matching import match_detections, pair_targets
from most.membership.nearest import Nearest
from most.membership.point_seg_mlp import PointSegMLP, PointSegMLPSettings
from most.membership.pool import LabelledPairs, Mixing, PairPool
from most.membership.roi import Pairs, RegionOfInterest

__all__ = [
    "Channels",
    "Evidence",
    "LabelledPairs",
    "Mixing",
    "Nearest",
    "PairPool",
    "Pairs",
    "PointSegMLP",
    "PointSegMLPSettings",
    "RegionOfInterest",
    "match_detections",
    "pair_targets",
]
