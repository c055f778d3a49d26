"""From the U-Net's bottleneck to the bird's-eye-view map and back (paper, section III, "detection branch").

The voxels of one column are set side by side in channels ("we flatten voxel features along their height"), then two
3 x 3 convolutions run over the map. Few columns are occupied, so the first of them, by far the widest, visits those
only and spreads each over its 3 x 3 neighbours: the same result as a dense convolution, for a tenth of its cost.
Optionally a linear layer squeezes the columns beforehand, and the whole branch gets as narrow as its output.
"""

import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn

from most.norm import NormReLU
from most.sparse import SparseTensor


class BevBranch(nn.Module):
    """Flatten the height, convolve in the plane, and add what was found to the voxels it came from."""

    def __init__(self, voxel_channels: int, height: int, bev_channels: int, squeeze: bool, back: bool = True) -> None:
        """``back``: what is found is added to the voxels, for a decoder."""
        super().__init__()
        self.height = height  # layers of the bottleneck's grid
        stacked = voxel_channels * height
        self.squeeze = nn.Linear(stacked, bev_channels, bias=False) if squeeze else None
        self.squeeze_norm = NormReLU(bev_channels) if squeeze else None
        self.convs = nn.Sequential(
            ColumnConv(bev_channels if squeeze else stacked, bev_channels),
            NormReLU(bev_channels),
            nn.Conv2d(bev_channels, bev_channels, 3, padding=1, bias=False),
            NormReLU(bev_channels),
        )
        self.back = nn.Linear(bev_channels, voxel_channels) if back else None

    def forward(self, x: SparseTensor) -> tuple[SparseTensor, Float[Tensor, "batch bev x y"]]:
        """Return the voxels with the BEV features of their column added, and the BEV map."""
        # The voxels of a column are neighbours in the order of the sites.
        columns, column = torch.unique_consecutive(x.sites.coordinates[:, :3], return_inverse=True, dim=0)
        size_x, size_y, _ = x.sites.shape
        stack = self._stack(x, len(columns), column)
        spread = self.convs[0](stack, columns, (x.sites.batch_size, size_x, size_y))
        bev: Tensor = self.convs[1:](spread)
        if self.back is None:
            return x, bev
        batch, cell_x, cell_y = columns.unbind(1)
        found = self.back(bev.permute(0, 2, 3, 1)[batch, cell_x, cell_y])
        return x.with_features(x.features + found.index_select(0, column)), bev

    def _stack(self, x: SparseTensor, columns: int, column: Int64[Tensor, "voxels"]) -> Float[Tensor, "columns stack"]:
        """Set the voxels of a column side by side, lowest first; empty ones are zero."""
        channels = x.features.shape[1]
        stack = x.features.new_zeros(columns * self.height, channels)
        stack = stack.index_copy(0, column * self.height + x.sites.coordinates[:, 3], x.features)
        stack = stack.view(columns, self.height * channels)
        if self.squeeze is None or self.squeeze_norm is None:
            return stack
        out: Tensor = self.squeeze_norm(self.squeeze(stack))
        return out


class ColumnConv(nn.Conv2d):
    """A 3 x 3 convolution of a map that is zero but for some columns; its cost goes with their number."""

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__(in_channels, out_channels, 3, padding=1, bias=False)

    def forward(  # type: ignore[override]
        self,
        features: Float[Tensor, "columns in_channels"],
        columns: Int64[Tensor, "columns 3"],
        size: tuple[int, int, int],
    ) -> Float[Tensor, "batch out_channels x y"]:
        """Convolve columns at (batch, x, y) in a map of ``size`` (batch, x, y)."""
        batches, size_x, size_y = size[0], size[1] + 2, size[2] + 2  # a spare cell on each side takes what goes over
        cells = (columns[:, 0] * size_x + columns[:, 1] + 1) * size_y + columns[:, 2] + 1
        # Tap (i, j) of a convolution reads at (i - 1, j - 1) from its output: the column writes at the opposite.
        step = torch.tensor([(1 - i) * size_y + 1 - j for i in range(3) for j in range(3)], device=cells.device)
        products = (features @ self.weight.permute(1, 2, 3, 0).flatten(1)).view(-1, self.out_channels)
        spread = products.new_zeros(batches * size_x * size_y, self.out_channels)
        spread = spread.index_add(0, (cells[:, None] + step).flatten(), products)
        return spread.view(batches, size_x, size_y, self.out_channels)[:, 1:-1, 1:-1].permute(0, 3, 1, 2)
