"""From the network's inputs to the bottleneck of its U-Net, past the encoder."""

import torch
from torch import Tensor, nn

from most.norm import NormReLU
from most.sparse import SparseTensor


class Shortcut(nn.Module):
    """Adds to each voxel of the bottleneck what a layer makes of the mean of the inputs in it, and of their number.

    Every halving keeps what its own loss asks for. The age of points means nothing to the classes that most of the loss
    is of, and hardly reaches the bottleneck otherwise; which end of a moving object's trace is now hangs on it alone.
    """

    def __init__(self, in_channels: int, channels: int) -> None:
        """``in_channels`` of the inputs, ``channels`` of the bottleneck."""
        super().__init__()
        self.linear = nn.Linear(in_channels + 1, channels, bias=False)
        self.norm = NormReLU(channels)

    def forward(self, bottleneck: SparseTensor, inputs: SparseTensor, stride: int) -> SparseTensor:
        """Add; each voxel of the bottleneck is ``stride`` voxels of the inputs wide, and none of these lies outside."""
        batch, cells = inputs.sites.coordinates.split([1, 3], 1)
        row = bottleneck.sites.rows(torch.cat([batch, cells // stride], 1))
        count = torch.bincount(row, minlength=len(bottleneck.sites)).to(inputs.features.dtype)[:, None]
        sums = inputs.features.new_zeros(len(count), inputs.features.shape[1]).index_add(0, row, inputs.features)
        count = count.clamp(min=1)  # windows that overlap reach cells without inputs
        added: Tensor = self.norm(self.linear(torch.cat([sums / count, count.log()], 1)))
        return bottleneck.with_features(bottleneck.features + added)
