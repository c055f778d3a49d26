"""From the U-Net's bottleneck to the bird's-eye-view map and back (paper, section III, "detection branch").

The voxels of one column are set side by side in channels ("we flatten voxel features along their height"), then two
3 x 3 convolutions run over the dense map. Optionally the columns are squeezed by a linear layer first, which is a
sparse operation: only occupied columns cost anything, and the dense part gets as narrow as its output.
"""

import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn

from most.backbones.norm import NormReLU
from most.sparse import Sites, SparseTensor


class BevBranch(nn.Module):
    """Flatten the height, convolve in the plane, and add what was found to the voxels it came from."""

    def __init__(self, voxel_channels: int, height: int, bev_channels: int, squeeze: bool) -> None:
        super().__init__()
        self.height = height  # layers of the bottleneck's grid
        stacked = voxel_channels * height
        self.squeeze = nn.Linear(stacked, bev_channels, bias=False) if squeeze else None
        self.squeeze_norm = NormReLU(bev_channels) if squeeze else None
        self.convs = nn.Sequential(
            nn.Conv2d(bev_channels if squeeze else stacked, bev_channels, 3, padding=1, bias=False),
            NormReLU(bev_channels),
            nn.Conv2d(bev_channels, bev_channels, 3, padding=1, bias=False),
            NormReLU(bev_channels),
        )
        self.back = nn.Linear(bev_channels, voxel_channels)

    def forward(self, x: SparseTensor) -> tuple[SparseTensor, Float[Tensor, "batch bev x y"]]:
        """Return the voxels with the BEV features of their column added, and the BEV map."""
        cells, column = torch.unique_consecutive(_cells(x.sites), return_inverse=True)
        dense = self.convs(self._scatter(self._stack(x, len(cells), column), cells, x.sites))
        by_cell = dense.permute(0, 2, 3, 1).flatten(0, 2)
        voxels = x.features + self.back(by_cell[cells])[column]
        return x.with_features(voxels), dense

    def _stack(self, x: SparseTensor, columns: int, column: Int64[Tensor, "voxels"]) -> Float[Tensor, "columns stack"]:
        """Set the voxels of a column side by side, lowest first; empty ones are zero."""
        stack = x.features.new_zeros(columns * self.height, x.features.shape[1])
        stack = stack.index_copy(0, column * self.height + x.sites.coordinates[:, 3], x.features).view(
            columns, self.height * x.features.shape[1]
        )
        if self.squeeze is None or self.squeeze_norm is None:
            return stack
        out: Tensor = self.squeeze_norm(self.squeeze(stack))
        return out

    def _scatter(
        self, stack: Float[Tensor, "columns stack"], cells: Int64[Tensor, "columns"], sites: Sites
    ) -> Float[Tensor, "batch stack x y"]:
        """Lay the columns out as a dense map (channels last in memory, which is also what convolutions like)."""
        size_x, size_y, _ = sites.shape
        dense = stack.new_zeros(sites.batch_size * size_x * size_y, stack.shape[1]).index_copy(0, cells, stack)
        return dense.view(sites.batch_size, size_x, size_y, stack.shape[1]).permute(0, 3, 1, 2)


def _cells(sites: Sites) -> Int64[Tensor, "voxels"]:
    """Number the BEV cell of each voxel; voxels of one column are neighbours in the order of the sites."""
    batch, x, y, _ = sites.coordinates.unbind(1)
    return (batch * sites.shape[0] + x) * sites.shape[1] + y
