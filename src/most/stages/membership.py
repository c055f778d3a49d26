"""Stage 2: PointSegMLP on the frozen stage 1 (paper, Eq. 3 and implementation details)."""

from dataclasses import dataclass, replace
from typing import Any

import lightning as L
import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.errors import ConfigError
from most.inference import Prediction, Predictor
from most.membership import Evidence, Nearest, PointSegMLP, match_detections, pair_targets
from most.processes import mean_over_all
from most.stages.scores import Scores
from most.structures import Sample


@dataclass
class MembershipTraining:
    """Optimiser and length of stage 2; the defaults are the paper's."""

    lr: float = 5e-4
    momentum: float = 0.9
    clip: float | None = None  # norm of the gradient
    batch_size: int = 8  # effective: scans an optimiser step, over all accumulated batches
    epochs: int = 20

    def __post_init__(self) -> None:
        numbers = {"lr": self.lr, "batch_size": self.batch_size, "epochs": self.epochs}
        for name, value in (numbers if self.clip is None else numbers | {"clip": self.clip}).items():
            if not value > 0:
                raise ConfigError(f"stage.membership.{name}: expected a positive number, found {value}")
        if not 0 <= self.momentum < 1:
            raise ConfigError(f"stage.membership.momentum: expected a number in [0, 1), found {self.momentum}")


class MembershipStage(L.LightningModule):
    """Trains on exactly the pairs that inference sees; no weight or running statistic of stage 1 changes."""

    name = "membership"
    prefix = "membership/"  # of the names under which losses and figures are logged

    def __init__(
        self,
        predictor: Predictor,
        mlp: PointSegMLP,
        taxonomy: Taxonomy,
        training: MembershipTraining,
        description: dict[str, Any],
    ) -> None:
        """``predictor`` is stage 1; ``description`` goes into the checkpoints, see :class:`DetectionStage`."""
        super().__init__()
        self.network = predictor.network.eval().requires_grad_(False)
        self.membership = mlp
        self.predictor = replace(predictor, membership=mlp)
        self.baseline = replace(predictor, membership=Nearest())
        self.taxonomy = taxonomy
        self.training_settings = training
        self.description = description
        self.scores, self.baseline_scores = Scores(taxonomy), Scores(taxonomy)
        self.report: dict[str, Any] = {}  # the last validation's figures

    def train(self, mode: bool = True) -> "MembershipStage":
        """Stage 1 stays in eval mode."""
        super().train(mode)
        self.network.eval()
        return self

    def loss(self, evidence: list[Evidence], samples: list[Sample]) -> Float[Tensor, ""]:
        """Return binary cross-entropy, averaged over all pairs of the batch whose truth is known (Eq. 3)."""
        described, targets = map(torch.cat, zip(*map(self._pairs, evidence, samples), strict=True))
        total = F.binary_cross_entropy_with_logits(self.membership.logits(described), targets, reduction="sum")
        return mean_over_all(total, torch.tensor(len(targets), device=total.device))

    def _pairs(
        self, evidence: Evidence, sample: Sample
    ) -> tuple[Float[Tensor, "known features"], Float[Tensor, "known"]]:
        """Return what the network sees of a sweep's pairs, and what it shall say."""
        assert sample.semantics is not None  # training splits are labelled
        assert sample.labels is not None
        assert sample.instances is not None
        found, roi = evidence.detections, self.predictor.settings.roi
        pairs = roi.pairs(evidence.points, evidence.semantics, found)
        matches = match_detections(found, roi.half_sizes(found.extents), sample.instances)
        targets, known = pair_targets(pairs, found.classes, matches, sample.semantics, sample.labels, sample.instances)
        return self.membership.describe(evidence, pairs.select(known)), targets[known]

    def training_step(self, samples: list[Sample], _: int) -> Float[Tensor, ""]:
        """One batch on what stage 1 says of it."""
        with torch.no_grad():
            evidence = self.predictor.see(samples)
        loss = self.loss(evidence, samples)
        self.log(f"{self.prefix}train/loss", loss.detach(), batch_size=len(samples), sync_dist=True)
        return loss

    def validation_step(self, samples: list[Sample], _: int) -> dict[str, Any]:
        """Predict a batch, by the network and by the nearest centre, and score both."""
        evidence = self.predictor.see(samples)
        predictions = [self.predictor.fuse(sweep) for sweep in evidence]
        self.scores.update(samples, predictions)
        self.baseline_scores.update(samples, [self.baseline.fuse(sweep) for sweep in evidence])
        return {"predictions": predictions}

    def on_validation_epoch_end(self) -> None:
        """Log the split's figures, fractions in [0, 1], and beside them those of the nearest centre."""
        epochs = self.current_epoch + int(self.trainer.state.fn == "fit")  # the running one is not counted yet
        figures, baseline = self.scores.take(), self.baseline_scores.take()
        self.report = {"epochs": epochs, "panoptic": figures, "panoptic_nearest": baseline}
        self.log_dict({f"{self.prefix}val/{name}": value for name, value in figures.items() if name != "per_class"})
        self.log_dict(
            {f"{self.prefix}val/nearest_{name}": value for name, value in baseline.items() if name != "per_class"}
        )

    def predict_step(self, samples: list[Sample], _: int) -> list[Prediction]:
        """Label every point of a batch's current sweeps."""
        return self.predictor(samples)

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Add what it takes to make both networks again."""
        checkpoint.update(self.description)

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """Plain SGD (implementation details)."""
        settings = self.training_settings
        return torch.optim.SGD(self.membership.parameters(), lr=settings.lr, momentum=settings.momentum)
