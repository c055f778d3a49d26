"""Stage 1: the detection and segmentation network, trained jointly (paper, implementation details)."""

from collections.abc import Iterable
from typing import Any

import torch
from jaxtyping import Bool, Float, Int64
from lightning.pytorch.utilities.types import OptimizerLRSchedulerConfig
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.inference import Predictor
from most.losses import (
    class_weights,
    focal_loss,
    lovasz_loss,
    offset_loss,
    regression_losses,
    semantic_loss,
)
from most.modal.offsets import centre_offsets
from most.modal.targets import bev_targets
from most.modal.voxel_labels import majority
from most.network import NetworkOutput
from most.stages.scores import Scores
from most.stages.settings import DetectionTraining
from most.stages.stage import Stage
from most.structures import BevMaps, Sample


class DetectionStage(Stage):
    """Wires network, targets, losses and metrics."""

    name, prefix = "detection", ""
    class_weights: Tensor

    def __init__(
        self,
        predictor: Predictor,
        taxonomy: Taxonomy,
        class_counts: Int64[Tensor, "classes"],
        training: DetectionTraining,
        description: dict[str, Any],
        steps: int,
    ) -> None:
        """``class_counts`` are the training split's points of each class, void first.

        ``steps`` counts those of the optimiser in the whole training.
        """
        super().__init__(predictor, taxonomy, description, training.epochs)
        self.network = predictor.network
        self.training_settings = training
        self.steps = steps
        weights = class_weights(class_counts[1:], training.losses.class_balance)
        self.register_buffer("class_weights", weights, persistent=False)
        self.scores = Scores(taxonomy)

    def losses(self, samples: list[Sample], output: NetworkOutput) -> dict[str, Float[Tensor, ""]]:
        """Return each loss, unweighted (Eq. 1, 2, 4)."""
        semantics = torch.cat([sample.semantics for sample in samples if sample.semantics is not None])
        semantics = semantics[self._in_range(samples)]
        voxels = output.voxels
        voxel_semantics = majority(
            voxels.point_voxel[output.current], semantics, len(voxels), self.taxonomy.num_classes
        )
        lovasz = self.training_settings.losses.lovasz > 0  # it sorts: not for nothing
        return {
            "voxel": semantic_loss(output.voxel_logits, voxel_semantics, self.class_weights),
            **({"lovasz": lovasz_loss(output.voxel_logits, voxel_semantics)} if lovasz else {}),
            "point": semantic_loss(output.point_logits, semantics, self.class_weights),
            **(self._offset_losses(samples, output) if output.maps is None else self._map_losses(samples, output.maps)),
        }

    def _map_losses(self, samples: list[Sample], maps: BevMaps) -> dict[str, Float[Tensor, ""]]:
        bev = self.network.bev_grid
        targets = bev_targets(
            [sample.instances for sample in samples if sample.instances is not None],
            bev.lower, bev.cell, bev.shape, self.taxonomy.things, self.training_settings.targets,
        )  # fmt: skip
        return {"heatmap": focal_loss(maps.heatmap, targets.heatmap), **regression_losses(maps, targets)}

    def _offset_losses(self, samples: list[Sample], output: NetworkOutput) -> dict[str, Float[Tensor, ""]]:
        """Points of things with an instance learn their offsets, as the modal targets have them."""
        targets = [
            centre_offsets(sample.points[: sample.num_current, :3], sample.labels, sample.instances)
            for sample in samples
            if sample.labels is not None and sample.instances is not None
        ]
        offsets, known = (torch.cat(each)[self._in_range(samples)] for each in zip(*targets, strict=True))
        assert output.offsets is not None  # either maps or offsets
        return {"offset": offset_loss(output.offsets, offsets, known)}

    def _in_range(self, samples: list[Sample]) -> Bool[Tensor, "points"]:
        """Whether the network sees each of the current sweeps' points."""
        grid = self.network.grid
        return torch.cat([grid.in_range(sample.points[: sample.num_current]) for sample in samples])

    def training_step(self, samples: list[Sample], _: int) -> Float[Tensor, ""]:
        """One batch: every loss is logged apart, and their weighted sum is returned (Eq. 5)."""
        losses = self.losses(samples, self.network(samples))
        weights = self.training_settings.losses
        total = torch.stack([getattr(weights, name) * loss for name, loss in losses.items()]).sum()
        logged = {f"train/loss_{name}": loss.detach() for name, loss in losses.items()}
        self.log_dict(logged | {"train/loss": total.detach()}, batch_size=len(samples), sync_dist=True)
        return total

    def validation_step(self, samples: list[Sample], _: int) -> dict[str, Any]:
        """Predict a batch and score it."""
        predictions = self.predict_step(samples, 0)
        self.scores.update(samples, predictions)
        return {"predictions": predictions}

    def on_validation_epoch_end(self) -> None:
        """Score the split."""
        self.publish(panoptic=self.scores.take())

    def configure_optimizers(self) -> OptimizerLRSchedulerConfig:
        """See :func:`one_cycle`."""
        optimizer, schedule = one_cycle(self.network.parameters(), self.training_settings, self.steps)
        return {
            "optimizer": optimizer,
            "lr_scheduler": {"scheduler": schedule, "interval": "step", "name": "learning_rate"},
        }


def one_cycle(
    parameters: Iterable[Tensor], settings: DetectionTraining, steps: int
) -> tuple[torch.optim.Optimizer, torch.optim.lr_scheduler.OneCycleLR]:
    """Return Adam or AdamW and its one-cycle schedule over ``steps`` (supplement, section II).

    However few steps there are, the first is at the initial rate and the second is the earliest at the highest.
    """
    kind = torch.optim.AdamW if settings.optimizer == "adamw" else torch.optim.Adam
    optimizer = kind(parameters, lr=settings.max_lr, weight_decay=settings.weight_decay)
    steps = max(steps, 3)
    warm_up = max(settings.warm_up, 2 / steps)  # torch divides by zero where the warm-up is one step long
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, settings.max_lr, steps, pct_start=warm_up, div_factor=settings.initial_divisor
    )
    return optimizer, schedule
