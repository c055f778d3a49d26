"""The scores of a split while a stage validates."""

from typing import Any

from jaxtyping import Int64
from torch import Tensor, nn

from most.datasets.taxonomy import Taxonomy
from most.inference import Prediction
from most.metrics import MembershipAccuracy, PanopticQuality
from most.metrics.instances import find_instances
from most.structures import Sample


class Scores(nn.Module):
    """Panoptic quality and membership accuracy of labelled sweeps; samples without labels do not count.

    Detections are held against modal centres, whatever the extent strategy has them trained for, as in evaluation.
    """

    confusion: Int64[Tensor, "classes classes"]  # of the split taken last: points, indexed [predicted, truth]

    def __init__(self, taxonomy: Taxonomy) -> None:
        super().__init__()
        self.taxonomy = taxonomy
        self.quality = PanopticQuality(taxonomy.class_names, taxonomy.things, taxonomy.min_points)
        self.membership = MembershipAccuracy()

    def update(self, samples: list[Sample], predictions: list[Prediction]) -> None:
        """Add a batch."""
        for sample, prediction in zip(samples, predictions, strict=True):
            if sample.labels is None or sample.semantics is None:
                continue
            points = sample.points[: sample.num_current, :3]
            panoptic = prediction.panoptic
            written = self.taxonomy.encode(panoptic.semantics, panoptic.ids)
            self.quality.update(panoptic.semantics, written, sample.semantics, sample.labels)
            self.membership.update(
                points, panoptic.semantics, sample.semantics, sample.labels,
                prediction.detections, prediction.roi, prediction.claimed,
                find_instances(points, sample.labels, sample.semantics, self.taxonomy),
            )  # fmt: skip

    def take(self) -> dict[str, Any]:
        """Return the figures, fractions in [0, 1], those of each class under ``per_class``, and start afresh."""
        figures = self.quality.compute() | self.membership.compute() | {"per_class": self.quality.per_class()}
        with self.quality.sync_context():
            self.confusion = self.quality.confusion.cpu()
        self.quality.reset()
        self.membership.reset()
        return figures
