"""Batch normalisation with ReLU, over voxel features or the cells of a BEV map: the one place to change it."""

import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn


class NormReLU(nn.BatchNorm1d):
    """Batch normalisation over all dimensions but the second, then ReLU (unless ``relu=False``).

    Where fewer than two rows make a variance meaningless (an empty crop, a lone voxel), training falls back on the
    running statistics and leaves them as they are.
    """

    def __init__(self, channels: int, relu: bool = True) -> None:
        super().__init__(channels)
        self.relu = relu

    def forward(self, x: Float[Tensor, "rows channels ..."]) -> Float[Tensor, "rows channels ..."]:
        """Normalise; the input is not needed after this."""
        measure = self.training and x.numel() // x.shape[1] > 1
        out = F.batch_norm(
            x, self.running_mean, self.running_var, self.weight, self.bias, measure, self.momentum or 0.0, self.eps
        )
        return F.relu_(out) if self.relu else out
