"""The sparse U-Net: three halvings, a bird's-eye-view branch at the bottom, a decoder back to full resolution."""

import itertools

from torch import nn

from most.backbones.bev import BevBranch
from most.backbones.blocks import Down, Up
from most.backbones.contract import Backbone, BackboneFeatures
from most.backbones.shortcut import Shortcut
from most.sparse import SparseTensor


class UNet(Backbone):
    """Encoder, BEV branch and decoder over sparse voxels (paper, figure 2 and appendix, implementation details)."""

    def __init__(
        self,
        in_channels: int,
        widths: list[int],
        block: type[nn.Module],
        down_kernel: int,
        bottleneck_height: int,
        bev_channels: int,
        bev_squeeze: bool,
        shortcut: bool,
        decoder: bool,
    ) -> None:
        super().__init__()
        self.voxel_channels = widths[0] if decoder else 0
        self.bev_channels, self.bev_stride = bev_channels, 2 ** (len(widths) - 1)
        steps = list(itertools.pairwise(widths))
        self.stem = block(in_channels, widths[0])
        self.down = nn.ModuleList(Down(fine, coarse, down_kernel, block) for fine, coarse in steps)
        self.shortcut = Shortcut(in_channels, widths[-1]) if shortcut else None
        self.bev = BevBranch(widths[-1], bottleneck_height, bev_channels, bev_squeeze, back=decoder)
        ups = reversed(steps) if decoder else ()
        self.up = nn.ModuleList(Up(coarse, fine, down_kernel, block) for fine, coarse in ups)

    def forward(self, x: SparseTensor) -> BackboneFeatures:
        """Encode, look from above, decode."""
        levels = [self.stem(x)]
        for down in self.down:
            levels.append(down(levels[-1]))
        bottleneck = levels.pop()
        if self.shortcut is not None:
            bottleneck = self.shortcut(bottleneck, x, self.bev_stride)
        y, bev = self.bev(bottleneck)
        for up in self.up:
            y = up(y, levels.pop())
        return BackboneFeatures(voxels=y.features if self.up else x.features[:, :0], bev=bev)
