"""Means of rows by the group that each belongs to: points by voxel or segment, voxels by a wider voxel."""

import torch
from jaxtyping import Float, Int64
from torch import Tensor


def group_means(
    values: Float[Tensor, "rows channels"], group: Int64[Tensor, "rows"], count: int
) -> tuple[Float[Tensor, "groups channels"], Int64[Tensor, "groups"]]:
    """Return the means of ``count`` groups of rows, and how many rows each has; a group without any has 0.

    They are of the values' type, but of float32 at least: a sum of many rows in half precision stops growing.
    """
    exact = torch.promote_types(values.dtype, torch.float32)
    sizes = torch.bincount(group, minlength=count)
    sums = values.new_zeros(count, values.shape[1], dtype=exact).index_add(0, group, values.to(exact))
    return sums / sizes.clamp(min=1)[:, None], sizes
