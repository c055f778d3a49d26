"""A similarity transform about the sensor's vertical: turn, mirror, scale, move. What augmentation does to a window."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Float64
from torch import Tensor


@dataclass(frozen=True)
class Similarity:
    """``x -> linear @ x + translation``; ``linear`` is a scale times a rotation or reflection that leaves z upright."""

    linear: Float64[Tensor, "3 3"]
    translation: Float64[Tensor, "3"]  # m

    @staticmethod
    def identity() -> "Similarity":
        """Nothing moves."""
        return Similarity(torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64))

    def apply(self, points: Float[Tensor, "points 3"]) -> Float[Tensor, "points 3"]:
        """Move points, in their own precision."""
        return points @ self.linear.T.to(points.dtype) + self.translation.to(points.dtype)
