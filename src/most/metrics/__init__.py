"""The benchmarks' figures: pure functions, and running totals of them for training."""

from most.metrics.membership import MembershipCounts, membership_counts
from most.metrics.panoptic import PanopticStatistics, panoptic_figures, panoptic_statistics, per_class
from most.metrics.running import MembershipAccuracy, PanopticQuality
from most.metrics.running_tracking import NuScenesLSTQ, PanopticTracking, SemanticKITTILSTQ
from most.metrics.split_sums import SplitSums

__all__ = [
    "MembershipAccuracy",
    "MembershipCounts",
    "NuScenesLSTQ",
    "PanopticQuality",
    "PanopticStatistics",
    "PanopticTracking",
    "SemanticKITTILSTQ",
    "SplitSums",
    "membership_counts",
    "panoptic_figures",
    "panoptic_statistics",
    "per_class",
]
