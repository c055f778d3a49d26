"""Stage-1 losses (paper, Eq. 1, 2 and 4): cross-entropy on voxels and points, focal loss and L1 on modal centres."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor
from torch.nn import functional as F

from most.errors import ConfigError
from most.modal.targets import BevTargets
from most.processes import mean_over_all
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
    yaw: float = 1.0  # of amodal boxes alone
    lovasz: float = 0.0  # on voxels; not the paper's
    class_balance: float = 0.0  # cross-entropy weights are (class frequency) ** -class_balance

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value < 0:
                raise ConfigError(f"stage.detection.losses.{name}: expected a number >= 0, found {value}")


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
    return mean_over_all(total, weights[(semantics[semantics > 0] - 1)].sum(), 1e-6)


def lovasz_loss(logits: Float[Tensor, "items classes"], semantics: Int64[Tensor, "items"]) -> Float[Tensor, ""]:
    """Lovász-Softmax (CVPR 2018, Eq. 11): a surrogate of 1 - IoU, averaged over the classes present; void is left out.

    It is no sum over items: several processes average the losses of their own items.

    Sorted by error, the n-th item weighs what it adds to 1 - IoU when the first n are the ones that are wrong.
    """
    known = semantics > 0
    truth = semantics[known] - 1
    present = truth.unique()
    is_class = (truth[:, None] == present).float()
    errors = (is_class - logits[known].float().softmax(1)[:, present]).abs()
    errors, order = errors.sort(dim=0, descending=True)
    is_class = is_class.gather(0, order)
    missed, invented = is_class.cumsum(0), (1 - is_class).cumsum(0)
    loss = 1 - (is_class.sum(0) - missed) / (is_class.sum(0) + invented)
    steps = torch.cat([loss[:1], loss[1:] - loss[:-1]])
    return (errors * steps).sum() / max(len(present), 1)


def focal_loss(
    logits: Float[Tensor, "batch things x y"], target: Float[Tensor, "batch things x y"]
) -> Float[Tensor, ""]:
    """CenterPoint's focal loss (alpha 2, beta 4) over the heat map, divided by the number of centres (Eq. 2)."""
    probability = logits.float().sigmoid().clamp(EPSILON, 1 - EPSILON)
    centre = target == 1
    missed = (1 - probability) ** 2 * probability.log()
    invented = (1 - target) ** 4 * probability**2 * (1 - probability).log()
    return mean_over_all(-torch.where(centre, missed, invented).sum(), centre.sum())


def offset_loss(
    offsets: Float[Tensor, "points 3"], targets: Float[Tensor, "points 3"], known: Bool[Tensor, "points"]
) -> Float[Tensor, ""]:
    """L1 of the offsets to modal centres (DS-Net), averaged over the points whose instance is known."""
    return mean_over_all((offsets - targets)[known].float().abs().sum(), known.sum())


def regression_losses(maps: BevMaps, targets: BevTargets) -> dict[str, Float[Tensor, ""]]:
    """L1 at the centre cells, averaged over instances (Eq. 2 and 4); unknown velocities do not count.

    ``yaw`` is among them where both maps and targets have one.
    """
    batch, x, y = targets.cells.unbind(1)
    known = targets.velocity_known[:, None].float()
    count = torch.tensor(len(batch), device=batch.device)
    names = ["offset", "height", "extent"]
    names += ["yaw"] if maps.yaw is not None and targets.yaw is not None else []
    at_centres = {name: getattr(maps, name)[batch, :, x, y].float() for name in names}
    errors = {name: (value - getattr(targets, name)).abs().sum() for name, value in at_centres.items()}
    losses = {name: mean_over_all(error, count) for name, error in errors.items()}
    error = (maps.velocity[batch, :, x, y].float() - targets.velocity).abs() * known
    return losses | {"velocity": mean_over_all(error.sum(), known.sum())}
