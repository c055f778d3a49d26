"""The class of a voxel: what most of the current sweep's points in it are (design: voxel label)."""

import torch
from jaxtyping import Int64
from torch import Tensor


def majority(
    point_voxel: Int64[Tensor, "points"], semantics: Int64[Tensor, "points"], num_voxels: int, num_classes: int
) -> Int64[Tensor, "voxels"]:
    """Return the training id most points of each voxel have; ties go to the lower id.

    Void points (0) have no vote, and a voxel without any other point is void. ``num_classes`` counts void.
    """
    votes = semantics != 0
    ballots, counts = torch.unique(point_voxel[votes] * num_classes + semantics[votes], return_counts=True)
    ranks = counts * num_classes + (num_classes - 1 - ballots % num_classes)  # most votes, then the lower id
    best = ranks.new_zeros(num_voxels).scatter_reduce_(0, ballots // num_classes, ranks, "amax")
    return torch.where(best > 0, num_classes - 1 - best % num_classes, 0)
