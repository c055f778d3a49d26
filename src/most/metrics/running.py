"""The metrics as running totals that sum over scans and processes (torchmetrics)."""

from collections.abc import Sequence
from dataclasses import astuple, fields

import torch
from jaxtyping import Float, Int64
from torch import Tensor
from torchmetrics import Metric

from most.metrics.exact_sums import exact_parts, joined
from most.metrics.membership import MembershipCounts, membership_counts
from most.metrics.panoptic import PanopticStatistics, panoptic_figures, panoptic_statistics, per_class
from most.structures import Detections, Instances

COUNTS = ("confusion", "tp", "fp", "fn")  # of PanopticStatistics; the sums of IoUs are added up apart


class PanopticQuality(Metric):
    """PQ, SQ, RQ, PQ-dagger and mIoU as the official evaluators print them."""

    full_state_update = False
    higher_is_better = True
    iou_sum: Tensor

    def __init__(self, class_names: Sequence[str], things: Sequence[int], min_points: int) -> None:
        """``class_names`` are indexed by training id, void first; ``things`` are training ids."""
        super().__init__()
        self.class_names, self.things, self.min_points = list(class_names), list(things), min_points
        zeros = PanopticStatistics.zeros(len(self.class_names))
        for name in COUNTS:
            self.add_state(name, default=getattr(zeros, name), dist_reduce_fx="sum")
        self.add_state("iou_sum", default=exact_parts(zeros.iou_sum), dist_reduce_fx="sum")

    def update(
        self,
        pred_semantics: Int64[Tensor, "points"],
        pred_keys: Int64[Tensor, "points"],
        truth_semantics: Int64[Tensor, "points"],
        truth_keys: Int64[Tensor, "points"],
    ) -> None:
        """Add one scan; keys are whole raw labels."""
        scan = panoptic_statistics(
            pred_semantics, pred_keys, truth_semantics, truth_keys, len(self.class_names), self.min_points
        )
        for name in COUNTS:
            setattr(self, name, getattr(self, name) + getattr(scan, name).to(self.device))
        self.iou_sum = self.iou_sum + exact_parts(scan.iou_sum).to(self.device)

    def compute(self) -> dict[str, float]:
        """Return the means, see :func:`most.metrics.panoptic.panoptic_figures`."""
        return panoptic_figures(self._statistics(), self.things)

    def per_class(self) -> dict[str, dict[str, float]]:
        """Return each class's figures, see :func:`most.metrics.panoptic.per_class`; call it on every process."""
        with self.sync_context():
            return per_class(self._statistics(), self.class_names)

    def _statistics(self) -> PanopticStatistics:
        counts = {name: getattr(self, name).cpu() for name in COUNTS}
        return PanopticStatistics(iou_sum=joined(self.iou_sum).cpu(), **counts)


class MembershipAccuracy(Metric):
    """Membership accuracy and its contested form."""

    full_state_update = False
    higher_is_better = True
    counts: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.add_state(
            "counts", default=torch.zeros(len(fields(MembershipCounts)), dtype=torch.long), dist_reduce_fx="sum"
        )

    def update(
        self,
        points: Float[Tensor, "points 3"],
        semantics: Int64[Tensor, "points"],
        truth_semantics: Int64[Tensor, "points"],
        truth_labels: Int64[Tensor, "points"],
        detections: Detections,
        roi: Float[Tensor, "detections 3"],
        assigned: Int64[Tensor, "points"],
        truth: Instances,
    ) -> None:
        """Add one sweep, see :func:`most.metrics.membership.membership_counts`."""
        scan = membership_counts(points, semantics, truth_semantics, truth_labels, detections, roi, assigned, truth)
        self.counts = self.counts + torch.tensor(astuple(scan), device=self.device)

    def compute(self) -> dict[str, float]:
        """Return both accuracies, NaN where no point was counted."""
        return MembershipCounts(*self.counts.tolist()).accuracies()
