"""Membership (paper, Eq. 3, Table II): which points are an instance; pairs of points and centres tell, or clusters."""

from most.membership.claims import Claims, Membership
from most.membership.clustering import Clustering
from most.membership.evidence import Channels, Evidence
from most.membership.matching import match_detections, pair_targets
from most.membership.mean_shift import MeanShift
from most.membership.nearest import Nearest
from most.membership.point_seg_mlp import PointSegMLP, PointSegMLPSettings
from most.membership.pool import LabelledPairs, Mixing, PairPool
from most.membership.rating import Rating
from most.membership.roi import Pairs, RegionOfInterest

__all__ = [
    "Channels",
    "Claims",
    "Clustering",
    "Evidence",
    "LabelledPairs",
    "MeanShift",
    "Membership",
    "Mixing",
    "Nearest",
    "PairPool",
    "Pairs",
    "PointSegMLP",
    "PointSegMLPSettings",
    "Rating",
    "RegionOfInterest",
    "match_detections",
    "pair_targets",
]
