"""The metrics of whole sequences as running totals that sum over scans and processes (torchmetrics)."""

from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np
import torch
from jaxtyping import Int64
from torch import Tensor

from most.metrics.exact_sums import exact_parts, joined
from most.metrics.lstq import Association, associate_by_sequence, lstq_nuscenes, lstq_per_class, lstq_semantickitti
from most.metrics.overlaps import find_overlaps, totals
from most.metrics.panoptic import PanopticStatistics
from most.metrics.running import COUNTS
from most.metrics.table_metric import TableMetric
from most.metrics.tables import table
from most.metrics.tracking import TrackingRules, TrackingStatistics, TrackMemory, tracking_statistics
from most.metrics.tracking_figures import track_qualities, tracking_figures, tracking_per_class
from most.metrics.tubes import TubeRules, TubeStatistics, tube_statistics


class _LSTQ(TableMetric):
    """LSTQ, whose scans may come in any order, and be shared by processes in any way."""

    confusion: Tensor

    def __init__(self, class_names: Sequence[str], things: Sequence[int], rules: TubeRules) -> None:
        super().__init__()
        self.class_names, self.things, self.rules = list(class_names), list(things), rules
        size = len(self.class_names)
        self.add_state("confusion", default=torch.zeros(size, size, dtype=torch.int64), dist_reduce_fx="sum")
        self.add_table("truth", keys=3, amounts=1)
        self.add_table("pred", keys=2, amounts=2)
        self.add_table("overlaps", keys=4, amounts=2)

    def update(
        self,
        sequence: int,
        pred_semantics: Int64[Tensor, "points"],
        pred_ids: Int64[Tensor, "points"],
        truth_semantics: Int64[Tensor, "points"],
        truth_ids: Int64[Tensor, "points"],
    ) -> None:
        """Add one scan of a sequence; every process has to give a sequence the same number."""
        overlaps = find_overlaps(pred_semantics, pred_ids, truth_semantics, truth_ids)
        scan = tube_statistics(overlaps, sequence, self.rules, len(self.class_names))
        self.confusion.add_(scan.confusion.to(self.device))
        for name in ("truth", "pred", "overlaps"):
            self.add_rows(name, getattr(scan, name))

    def per_class(self) -> dict[str, dict[str, float]]:
        """Return each class's figures, see :func:`most.metrics.lstq.lstq_per_class`; call it on every process."""
        with self.sync_context():
            return lstq_per_class(self._statistics(), self.class_names)

    def by_sequence(self) -> dict[int, Association]:
        """Return the association of each sequence that has tubes; call it on every process."""
        with self.sync_context():
            return associate_by_sequence(self._statistics())

    def _statistics(self) -> TubeStatistics:
        return TubeStatistics(self.confusion.cpu(), self.rows("truth"), self.rows("pred"), self.rows("overlaps"))


class SemanticKITTILSTQ(_LSTQ):
    """LSTQ as the evaluator of 4D panoptic segmentation on SemanticKITTI prints it; ids are ``label >> 16``."""

    def __init__(self, class_names: Sequence[str], things: Sequence[int], min_points: int = 50) -> None:
        """``class_names`` are indexed by training id, void first; ``things`` are training ids."""
        super().__init__(class_names, things, TubeRules.semantickitti(len(class_names), min_points))

    def compute(self) -> dict[str, float]:
        """Return the figures, see :func:`most.metrics.lstq.lstq_semantickitti`."""
        return lstq_semantickitti(self._statistics(), self.things)


class NuScenesLSTQ(_LSTQ):
    """LSTQ as the nuScenes devkit prints it; ids are whole labels."""

    def __init__(self, class_names: Sequence[str], things: Sequence[int], min_points: int = 15) -> None:
        """``class_names`` are indexed by training id, void first; ``things`` are training ids."""
        super().__init__(class_names, things, TubeRules.nuscenes(things, min_points))

    def compute(self) -> dict[str, float]:
        """Return the figures, see :func:`most.metrics.lstq.lstq_nuscenes`."""
        return lstq_nuscenes(self._statistics(), self.things)


class PanopticTracking(TableMetric):
    """PAT, TQ, PTQ and sPTQ as the nuScenes devkit prints them; keys are whole labels.

    The scans of a sequence have to come in the order of time, all of them to the same process; sequences may alternate.
    """

    tables = ("tracks", "hits", "predictions")
    iou_sum: Tensor
    soft_switches: Tensor

    def __init__(self, class_names: Sequence[str], things: Sequence[int], min_points: int = 15) -> None:
        """``class_names`` are indexed by training id, void first; ``things`` are training ids."""
        super().__init__()
        self.class_names, self.things = list(class_names), list(things)
        self.rules = TrackingRules(len(self.class_names), tuple(things), min_points)
        self._memories: dict[int, TrackMemory] = {}
        zeros = PanopticStatistics.zeros(len(self.class_names))
        for name in COUNTS:
            self.add_state(name, default=getattr(zeros, name), dist_reduce_fx="sum")
        for name in ("iou_sum", "soft_switches"):
            self.add_state(name, default=exact_parts(zeros.iou_sum), dist_reduce_fx="sum")
        self.add_table("tracks", keys=3, amounts=2)
        self.add_table("hits", keys=4, amounts=1)
        self.add_table("predictions", keys=2, amounts=2)
        self.add_table("switches", keys=2, amounts=1)  # of a sequence's class
        self.add_table("sequences", keys=1, amounts=1)  # how many processes saw each

    def update(
        self,
        sequence: int,
        pred_semantics: Int64[Tensor, "points"],
        pred_keys: Int64[Tensor, "points"],
        truth_semantics: Int64[Tensor, "points"],
        truth_keys: Int64[Tensor, "points"],
    ) -> None:
        """Add the next scan of a sequence; every process has to give a sequence the same number."""
        overlaps = find_overlaps(pred_semantics, pred_keys, truth_semantics, truth_keys)
        if sequence not in self._memories:
            self.add_rows("sequences", table(np.array([sequence]), 1))
        memory = self._memories.get(sequence, TrackMemory())
        scan, self._memories[sequence] = tracking_statistics(overlaps, sequence, memory, self.rules)
        for name in COUNTS:
            getattr(self, name).add_(getattr(scan.panoptic, name).to(self.device))
        switched = np.flatnonzero(scan.switches.numpy())
        self.add_rows("switches", table(sequence, switched, scan.switches.numpy()[switched]))
        self.iou_sum.add_(exact_parts(scan.panoptic.iou_sum).to(self.device))
        self.soft_switches.add_(exact_parts(scan.soft_switches).to(self.device))
        for name in self.tables:
            self.add_rows(name, getattr(scan, name))

    def forward(self, *_: Any, **__: Any) -> NoReturn:
        """Raise TypeError: a scan has no figures of its own. Call ``update``, and ``compute`` in the end."""
        raise TypeError("PanopticTracking: expected update(...) for each scan, found a call for one scan's figures")

    def compute(self) -> dict[str, float]:
        """Return the figures, see :func:`most.metrics.tracking_figures.tracking_figures`.

        Raises ValueError if two processes, or two metrics merged, saw scans of one sequence.
        """
        return tracking_figures(self._statistics(), self.things)

    def per_class(self) -> dict[str, dict[str, float]]:
        """Return each class's figures, see ``tracking_per_class`` there; call it on every process."""
        with self.sync_context():
            return tracking_per_class(self._statistics(), self.class_names)

    def by_sequence(self) -> dict[int, dict[str, list[Any]]]:
        """Return ``{switches: [by class], tq: [their sum, tracks]}`` of each sequence that has tracks or switches.

        PTQ and PAT are formed of their sums and those of PQ. Call it on every process.
        """
        with self.sync_context():
            switches, qualities = self.rows("switches"), track_qualities(self._statistics())
        found: dict[int, dict[str, list[Any]]] = {}
        for sequence in np.union1d(switches[:, 0], qualities.sequences).tolist():
            own = qualities.official[qualities.sequences == sequence]
            changes = _by_class(switches[switches[:, 0] == sequence], len(self.class_names))
            found[sequence] = {"switches": changes.tolist(), "tq": [float(own.sum()), len(own)]}
        return found

    def reset(self) -> None:
        """Forget all scans."""
        super().reset()
        self._memories = {}

    def _statistics(self) -> TrackingStatistics:
        sequences = self.rows("sequences")
        if len(torn := sequences[sequences[:, 1] > 1, 0]):
            raise ValueError(f"sequence {torn[0]}: expected all its scans in one process, found some in several")
        counts = {name: getattr(self, name).cpu() for name in COUNTS}
        return TrackingStatistics(
            PanopticStatistics(iou_sum=joined(self.iou_sum).cpu(), **counts),
            torch.from_numpy(_by_class(self.rows("switches"), len(self.class_names))),
            joined(self.soft_switches).cpu(),
            *(self.rows(name) for name in self.tables),
        )


def _by_class(switches: Int64[np.ndarray, "rows 3"], num_classes: int) -> Int64[np.ndarray, "classes"]:
    """Add up a table of sequence, class and switches."""
    return totals(switches[:, 1], switches[:, 2], num_classes)
