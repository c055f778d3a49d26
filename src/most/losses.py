"""Stage-1 losses (paper, Eq. 1, 2 and 4): cross-entropy on voxels and points, focal loss and L1 on modal centres."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor
from torch.nn import functional as F

from most.errors import ConfigError
from most.modal.targets import BevTargets
from most.structures import BevMaps

EPSILON = 1e-4  # probabilities are kept this far from 0 and 1


@dataclass
class LossWeights:
    """Weight of each loss in the sum (Eq. 5), and how far rare classes are lifted in the cross-entropy."""

    voxel: float = 1.0
    point: float = 1.0
    heatmap: float = 1.0
    offset: float = 1.0
    height: float = 1.0
    extent: float = 1.0
    velocity: float = 1.0
    class_balance: float = 0.0  # cross-entropy weights are (class frequency) ** -class_balance

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value < 0:
                raise ConfigError(f"stage.losses.{name}: expected a number >= 0, found {value}")


def class_weights(counts: Int64[Tensor, "classes"], class_balance: float) -> Float[Tensor, "classes"]:
    """Return frequency ** -class_balance, scaled to a mean of one over the points; absent classes weigh nothing."""
    frequency = counts.double() / counts.sum().clamp(min=1)
    weights = torch.where(counts > 0, frequency.clamp(min=1e-12) ** -class_balance, 0.0)
    return (weights / (weights * frequency).sum().clamp(min=1e-12)).float()


def semantic_loss(
    logits: Float[Tensor, "items classes"], semantics: Int64[Tensor, "items"], weights: Float[Tensor, "classes"]
) -> Float[Tensor, ""]:
    """Cross-entropy, averaged over the items that are not void (Eq. 1); ``semantics`` are training ids."""
    total = F.cross_entropy(logits.float(), semantics - 1, weights, ignore_index=-1, reduction="sum")
    return total / weights[(semantics[semantics > 0] - 1)].sum().clamp(min=1e-6)


def focal_loss(
    logits: Float[Tensor, "batch things x y"], target: Float[Tensor, "batch things x y"]
) -> Float[Tensor, ""]:
    """CenterPoint's focal loss (alpha 2, beta 4) over the heat map, divided by the number of centres (Eq. 2)."""
    probability = logits.float().sigmoid().clamp(EPSILON, 1 - EPSILON)
    centre = target == 1
    missed = (1 - probability) ** 2 * probability.log()
    invented = (1 - target) ** 4 * probability**2 * (1 - probability).log()
    return -torch.where(centre, missed, invented).sum() / centre.sum().clamp(min=1)


def regression_losses(maps: BevMaps, targets: BevTargets) -> dict[str, Float[Tensor, ""]]:
    """L1 at the centre cells, averaged over instances (Eq. 2 and 4); unknown velocities do not count."""
    batch, x, y = targets.cells.unbind(1)
    known = targets.velocity_known[:, None].float()
    count = max(len(batch), 1)
    at_centres = {name: getattr(maps, name)[batch, :, x, y].float() for name in ("offset", "height", "extent")}
    losses = {name: (value - getattr(targets, name)).abs().sum() / count for name, value in at_centres.items()}
    error = (maps.velocity[batch, :, x, y].float() - targets.velocity).abs() * known
    return losses | {"velocity": error.sum() / known.sum().clamp(min=1)}
