"""How a stage does on labelled sweeps."""

from typing import Any

import torch
from jaxtyping import Int64
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.inference import Prediction
from most.metrics import SplitSums, membership_counts
from most.metrics.instances import find_instances
from most.structures import Sample


class Scores:
    """Panoptic quality and membership accuracy of labelled sweeps; samples without labels do not count.

    Detections are held against modal centres, whatever the extent strategy has them trained for, as in evaluation.
    """

    def __init__(self, taxonomy: Taxonomy) -> None:
        self.taxonomy = taxonomy
        self.sums = SplitSums(taxonomy)
        size = taxonomy.num_classes  # of the split taken last: points, indexed [predicted, truth]
        self.confusion: Int64[Tensor, "classes classes"] = torch.zeros(size, size, dtype=torch.int64)

    def update(self, samples: list[Sample], predictions: list[Prediction]) -> None:
        """Add a batch."""
        for sample, prediction in zip(samples, predictions, strict=True):
            if sample.labels is None or sample.semantics is None:
                continue
            panoptic, points = prediction.panoptic, sample.points[: sample.num_current, :3]
            written = self.taxonomy.encode(panoptic.semantics, panoptic.ids)
            membership = membership_counts(
                points, panoptic.semantics, sample.semantics, sample.labels,
                prediction.detections, prediction.roi, prediction.claimed,
                find_instances(points, sample.labels, sample.semantics, self.taxonomy),
            )  # fmt: skip
            truth = (sample.semantics, sample.labels)
            self.sums.update(sample.sequence, (panoptic.semantics, written), truth, points, membership)

    def take(self) -> dict[str, Any]:
        """Return the figures of all processes and start afresh; each process has to call it.

        Fractions in [0, 1]; those of each class under ``per_class``, and what they are made of under ``sums``.
        """
        seen, self.sums = self.sums.of_all_processes(), SplitSums(self.taxonomy)
        self.confusion = seen.together().confusion
        return seen.figures() | {"sums": seen.plain()}
