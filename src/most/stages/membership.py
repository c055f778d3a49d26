"""Stage 2: PointSegMLP on the frozen stage 1 (paper, Eq. 3 and implementation details)."""

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import Any

import lightning as L
import torch
import torch.nn.functional as F
from jaxtyping import Float
from lightning.pytorch.core.optimizer import LightningOptimizer
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.errors import ConfigError
from most.inference import Prediction, Predictor
from most.membership import (
    Evidence,
    LabelledPairs,
    Mixing,
    Nearest,
    PairPool,
    PointSegMLP,
    match_detections,
    pair_targets,
)
from most.processes import mean_over_all
from most.stages.scores import Scores
from most.structures import Sample


@dataclass
class MembershipTraining:
    """Optimiser and length of stage 2; the defaults are the paper's."""

    lr: float = 5e-4
    momentum: float = 0.9
    batch_size: int = 8  # scans that stage 1 sees before the optimiser steps, over all processes
    epochs: int = 20
    mixing: Mixing = field(default_factory=Mixing)
    average: float = 0.0  # decay, each step, of the weights' running mean, which predicts; 0: the last weights do

    def __post_init__(self) -> None:
        for name in ("lr", "batch_size", "epochs"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"stage.membership.{name}: expected a positive number, found {getattr(self, name)}")
        for name in ("momentum", "average"):
            if not 0 <= getattr(self, name) < 1:
                raise ConfigError(f"stage.membership.{name}: expected a number in [0, 1), found {getattr(self, name)}")


class MembershipStage(L.LightningModule):
    """Trains on exactly the pairs that inference sees; no weight or running statistic of stage 1 changes."""

    name = "membership"
    prefix = "membership/"  # of the names under which losses and figures are logged
    followed: Tensor

    def __init__(
        self,
        predictor: Predictor,
        mlp: PointSegMLP,
        taxonomy: Taxonomy,
        training: MembershipTraining,
        description: dict[str, Any],
        seed: int = 0,
    ) -> None:
        """``predictor`` is stage 1; ``description`` goes into the checkpoints, see :class:`DetectionStage`.

        ``seed`` fixes which pairs are mixed.
        """
        super().__init__()
        self.automatic_optimization = False  # a batch of scans can be good for several steps
        self.pool = PairPool(training.mixing, seed)
        self.network = predictor.network.eval().requires_grad_(False)
        self.learner = mlp
        self.membership = deepcopy(mlp).requires_grad_(False)  # the running mean of what is learned
        self.predictor = replace(predictor, membership=self.membership)
        self.baseline = replace(predictor, membership=Nearest())
        self.taxonomy = taxonomy
        self.training_settings = training
        self.description = description
        self.register_buffer("followed", torch.zeros((), dtype=torch.long))  # steps
        self.scores, self.baseline_scores = Scores(taxonomy), Scores(taxonomy)
        self.report: dict[str, Any] = {}  # the last validation's figures

    def train(self, mode: bool = True) -> "MembershipStage":
        """Stage 1 stays in eval mode."""
        super().train(mode)
        self.network.eval()
        return self

    def loss(self, pairs: LabelledPairs) -> Float[Tensor, ""]:
        """Return binary cross-entropy, averaged over the pairs of all processes (Eq. 3)."""
        logits = self.learner.logits(pairs.described)
        total = F.binary_cross_entropy_with_logits(logits, pairs.members, reduction="sum")
        return mean_over_all(total, torch.tensor(len(pairs), device=total.device))

    def label(self, evidence: Evidence, sample: Sample) -> LabelledPairs:
        """Return what the network sees of a sweep's pairs whose truth is known, and what it shall say."""
        assert sample.semantics is not None  # training splits are labelled
        assert sample.labels is not None
        assert sample.instances is not None
        found, roi = evidence.detections, self.predictor.settings.roi
        pairs = roi.pairs(evidence.points, evidence.semantics, found)
        matches = match_detections(found, roi.half_sizes(found.extents), sample.instances)
        targets, known = pair_targets(pairs, found.classes, matches, sample.semantics, sample.labels, sample.instances)
        return LabelledPairs(self.learner.describe(evidence, pairs.select(known)), targets[known])

    def steps(self, scans: list[LabelledPairs]) -> Iterator[LabelledPairs]:
        """Yield the pairs of each of the optimiser's steps that a batch of scans is good for."""
        mixing = self.training_settings.mixing
        if mixing.scans == 0:
            yield LabelledPairs.cat(scans)
            return
        self.pool.add(scans)
        for _ in range(mixing.steps):
            yield self.pool.draw()

    def training_step(self, samples: list[Sample], _: int) -> None:
        """One batch: what stage 1 says of it, then the optimiser's steps."""
        with torch.no_grad():  # a sweep at a time: it is far larger than its pairs
            scans = [self.label(evidence, sample) for sample in samples for evidence in self.predictor.see([sample])]
        optimizer = self.optimizers()
        assert isinstance(optimizer, LightningOptimizer)  # the only one
        for pairs in self.steps(scans):
            loss = self.loss(pairs.to(self.device))
            optimizer.zero_grad()
            self.manual_backward(loss)
            optimizer.step()
            self.follow()
            self.log(f"{self.prefix}train/loss", loss.detach(), batch_size=len(samples), sync_dist=True)

    @torch.no_grad()
    def follow(self) -> None:
        """Move the running mean, of weights and of statistics, towards what was learned."""
        self.followed += 1
        share = 1 - min(self.training_settings.average, 1 - 1 / int(self.followed))  # at first the plain mean
        learned = self.learner.state_dict()
        for name, mean in self.membership.state_dict().items():
            if mean.is_floating_point():
                mean.lerp_(learned[name], share)

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
        """Add what it takes to make both networks again and, beside the optimiser's state, to go on exactly."""
        checkpoint.update(self.description)
        if "optimizer_states" in checkpoint:
            checkpoint["pool"] = self.pool.state()

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Go on with the pairs that were kept."""
        self.pool.restore(checkpoint["pool"])

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """Plain SGD (implementation details)."""
        settings = self.training_settings
        return torch.optim.SGD(self.learner.parameters(), lr=settings.lr, momentum=settings.momentum)
