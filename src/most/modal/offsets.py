"""What the offset head shall say: where each point's instance has its modal centre."""

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from most.structures import Instances


def centre_offsets(
    points: Float[Tensor, "points 3"], labels: Int64[Tensor, "points"], instances: Instances
) -> tuple[Float[Tensor, "points 3"], Bool[Tensor, "points"]]:
    """Return the offset (m) from each point to the modal centre of its instance, and whether it has one.

    ``labels`` are raw, as the instances' keys; without an instance the offset is zero.
    """
    keys, row = instances.keys.sort()
    place = torch.searchsorted(keys, labels).clamp(max=max(len(keys) - 1, 0))
    known = torch.isin(labels, keys)
    offsets = torch.zeros_like(points)
    offsets[known] = instances.centres[row[place[known]]] - points[known]
    return offsets, known
