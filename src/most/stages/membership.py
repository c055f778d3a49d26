"""Stage 2: PointSegMLP on the frozen stage 1 (paper, Eq. 3 and implementation details)."""

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from typing import Any

import torch
import torch.nn.functional as F
from jaxtyping import Float
from lightning.pytorch.core.optimizer import LightningOptimizer
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.inference import Predictor
from most.membership import (
    Evidence,
    LabelledPairs,
    Nearest,
    PairPool,
    PointSegMLP,
    match_detections,
    pair_targets,
)
from most.processes import mean_over_all
from most.stages.scores import Scores
from most.stages.settings import MembershipTraining
from most.stages.stage import Stage
from most.structures import Sample


class MembershipStage(Stage):
    """Trains on the pairs that inference sees and the truth answers; no weight or statistic of stage 1 changes."""

    name, prefix = "membership", "membership/"
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
        """``predictor`` is stage 1; ``seed`` fixes which pairs are mixed."""
        membership = deepcopy(mlp).requires_grad_(False)
        super().__init__(replace(predictor, membership=membership), taxonomy, description, training.epochs)
        self.automatic_optimization = False  # a batch of scans can be good for several steps
        self.pool = PairPool(training.mixing, seed)
        self.network = predictor.network.eval().requires_grad_(False)
        self.learner = mlp
        self.membership = membership  # the running mean of what is learned
        self.baseline = replace(predictor, membership=Nearest())
        self.training_settings = training
        self.register_buffer("followed", torch.zeros((), dtype=torch.long))  # steps
        self.scores, self.baseline_scores = Scores(taxonomy), Scores(taxonomy)

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
        """Score the split, and beside it the nearest centre's labels."""
        self.publish(panoptic=self.scores.take(), panoptic_nearest=self.baseline_scores.take())

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Add the pairs that were kept, where the checkpoint is one to go on from."""
        super().on_save_checkpoint(checkpoint)
        if "optimizer_states" in checkpoint:
            checkpoint["pool"] = self.pool.state()

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Go on with the pairs that were kept."""
        self.pool.restore(checkpoint["pool"])

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """Plain SGD (implementation details)."""
        settings = self.training_settings
        return torch.optim.SGD(self.learner.parameters(), lr=settings.lr, momentum=settings.momentum)
