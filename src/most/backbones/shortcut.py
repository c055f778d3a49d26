"""From the voxels that enter a U-Net to its bottleneck, past the halvings."""

import torch
from torch import Tensor, nn

from most.geometry.means import group_means
from most.norm import NormReLU
from most.sparse import SparseTensor


class Shortcut(nn.Module):
    """Adds to each voxel of the bottleneck what a layer makes of the mean and the number of the input voxels in it.

    In a short training the ages of points hardly get through the halvings, yet they alone tell which end of a moving
    object's trace is the present one.
    """

    def __init__(self, in_channels: int, channels: int) -> None:
        """``in_channels`` of the input voxels, ``channels`` of the bottleneck's."""
        super().__init__()
        self.linear = nn.Linear(in_channels + 1, channels, bias=False)
        self.norm = NormReLU(channels)

    def forward(self, bottleneck: SparseTensor, inputs: SparseTensor, stride: int) -> SparseTensor:
        """Add; the bottleneck's voxels are ``stride`` input voxels wide, and each of these lies in an occupied one."""
        batch, cells = inputs.sites.coordinates.split([1, 3], 1)
        row = bottleneck.sites.rows(torch.cat([batch, cells // stride], 1))
        means, counts = group_means(inputs.features, row, len(bottleneck.sites))
        counts = counts.clamp(min=1).to(means.dtype)  # windows that overlap reach cells without inputs
        added: Tensor = self.norm(self.linear(torch.cat([means, counts.log()[:, None]], 1)))
        return bottleneck.with_features(bottleneck.features + added)
