"""What a dataset's own evaluators say of whole sequences: 4D figures (paper, Table V), and all figures of labels."""

from typing import Any

from jaxtyping import Float, Int64
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.metrics.membership import MembershipCounts
from most.metrics.running_tracking import NuScenesLSTQ, PanopticTracking, SemanticKITTILSTQ
from most.metrics.split_sums import SplitSums


class SequenceScores:
    """Scans of a sequence are added in the order of time."""

    def __init__(self, taxonomy: Taxonomy) -> None:
        self.taxonomy = taxonomy
        self.numbers: dict[str, int] = {}  # of the sequences
        rules = (taxonomy.class_names, taxonomy.things, taxonomy.min_points)
        is_nuscenes = taxonomy.evaluator == "nuscenes"
        self.lstq = NuScenesLSTQ(*rules) if is_nuscenes else SemanticKITTILSTQ(*rules)
        self.tracking = PanopticTracking(*rules) if is_nuscenes else None

    def update(
        self,
        sequence: str,
        semantics: Int64[Tensor, "points"],
        labels: Int64[Tensor, "points"],
        truth_semantics: Int64[Tensor, "points"],
        truth_labels: Int64[Tensor, "points"],
    ) -> None:
        """Add a scan; labels are whole, as they are on disk."""
        number = self.numbers.setdefault(sequence, len(self.numbers))
        if self.tracking is None:
            instance = self.taxonomy.instance_of
            self.lstq.update(number, semantics, instance(labels), truth_semantics, instance(truth_labels))
            return
        self.lstq.update(number, semantics, labels, truth_semantics, truth_labels)
        self.tracking.update(number, semantics, labels, truth_semantics, truth_labels)

    def sums(self) -> dict[str, dict[str, list[Any]]]:
        """Return of each sequence what S_assoc is summed of, on nuScenes also PTQ and PAT, as ``sums`` has it."""
        size, found = self.taxonomy.num_classes, self.lstq.by_sequence()
        none: dict[str, list[Any]] = {"assoc": [0.0] * size, "tubes": [0] * size}
        tubes = {number: {"assoc": each.sums.tolist(), "tubes": each.tubes.tolist()} for number, each in found.items()}
        tracks = {} if self.tracking is None else self.tracking.by_sequence()
        untracked: dict[str, list[Any]] = {} if self.tracking is None else {"switches": [0] * size, "tq": [0.0, 0]}
        return {name: tubes.get(number, none) | tracks.get(number, untracked) for name, number in self.numbers.items()}

    def report(self) -> dict[str, Any]:
        """Return the section ``lstq``, or on nuScenes ``tracking``, with ``per_class``; fractions in [0, 1]."""
        lstq = self.lstq.compute()
        if self.tracking is None:
            return {"lstq": lstq | {"per_class": self.lstq.per_class()}}
        return {"tracking": lstq | self.tracking.compute() | {"per_class": self.tracking.per_class()}}


class LabelScores:
    """All figures of labels, and of memberships where they are known; scans of a sequence come in the order of time."""

    def __init__(self, taxonomy: Taxonomy) -> None:
        self.sums = SplitSums(taxonomy)
        self.sequences = SequenceScores(taxonomy)

    def update(
        self,
        sequence: str,
        semantics: Int64[Tensor, "points"],
        labels: Int64[Tensor, "points"],
        truth_semantics: Int64[Tensor, "points"],
        truth_labels: Int64[Tensor, "points"],
        points: Float[Tensor, "points 3"] | None = None,
        membership: MembershipCounts | None = None,
    ) -> None:
        """Add a scan; labels are whole, as they are on disk, and ``points`` in the sensor frame (m)."""
        self.sums.update(sequence, (semantics, labels), (truth_semantics, truth_labels), points, membership)
        self.sequences.update(sequence, semantics, labels, truth_semantics, truth_labels)

    def plain_sums(self) -> dict[str, Any]:
        """Return the section ``sums``, see :mod:`most.metrics.split_sums`, with what 4D figures are made of."""
        section = self.sums.plain()
        for name, sums in self.sequences.sums().items():
            section["sequences"][name] |= sums
        return section

    def report(self) -> dict[str, Any]:
        """Return the section ``panoptic`` with ``per_class``, and that of the 4D figures beside it."""
        return {"panoptic": self.sums.figures()} | self.sequences.report()
