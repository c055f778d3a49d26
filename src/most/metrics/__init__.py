"""The benchmarks' figures as pure functions; ``running`` and ``running_tracking`` are torchmetrics of them."""

from most.metrics.membership import MembershipCounts, membership_counts
from most.metrics.panoptic import PanopticStatistics, panoptic_figures, panoptic_statistics, per_class
from most.metrics.split_sums import SplitSums

__all__ = [
    "MembershipCounts",
    "PanopticStatistics",
    "SplitSums",
    "membership_counts",
    "panoptic_figures",
    "panoptic_statistics",
    "per_class",
]
