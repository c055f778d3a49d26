"""How segments of points measure: the modal centre of each, and how far its points reach."""

import torch
from jaxtyping import Float, Float32, Int64
from torch import Tensor

from most.geometry.means import group_means

SMALLEST = 0.05  # half-size of a segment of one point, m


def measure(
    points: Float[Tensor, "points 3"], row: Int64[Tensor, "points"], count: int
) -> tuple[Float32[Tensor, "segments 3"], Float32[Tensor, "segments 3"]]:
    """Return mean and half-sizes about it along the axes (m) of ``count`` segments; ``row`` names each point's.

    Points are finite. A segment without any is put at the origin.
    """
    near = points.double()
    centres, _ = group_means(near, row, count)
    reach = torch.full_like(centres, SMALLEST)
    reach.scatter_reduce_(0, row[:, None].expand(-1, 3), (near - centres[row]).abs(), "amax")
    return centres.float(), reach.float()
