"""Upright boxes: half-sizes along, across and up, turned about z by a yaw; no yaws at all mean boxes along the axes."""

import torch
from jaxtyping import Float
from torch import Tensor


def along(away: Float[Tensor, "*rows 3"], yaws: Float[Tensor, "..."] | None) -> Float[Tensor, "*rows 3"]:
    """Turn differences of places (m) into their boxes' own axes; ``yaws`` (radians) broadcast over the rows."""
    if yaws is None:
        return away
    cos, sin = yaws.cos(), yaws.sin()
    x, y, z = away.unbind(-1)
    return torch.stack([cos * x + sin * y, cos * y - sin * x, z], -1)


def bounds(half_sizes: Float[Tensor, "boxes 3"], yaws: Float[Tensor, "boxes"] | None) -> Float[Tensor, "boxes 3"]:
    """Return the half-sizes along the axes of what the boxes reach, m."""
    if yaws is None:
        return half_sizes
    cos, sin = yaws.cos().abs(), yaws.sin().abs()
    length, width, height = half_sizes.unbind(1)
    return torch.stack([cos * length + sin * width, sin * length + cos * width, height], 1)
