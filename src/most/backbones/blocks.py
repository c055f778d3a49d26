"""Residual blocks of submanifold convolutions."""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from most.norm import NormReLU
from most.sparse import InverseConv, Sites, SparseTensor, StridedConv, SubmanifoldConv

ACROSS_X = (3, 1, 3)
ACROSS_Y = (1, 3, 3)
CUBE = (3, 3, 3)


class ConvUnit(nn.Module):
    """Submanifold convolution, batch normalisation, ReLU."""

    def __init__(self, in_channels: int, out_channels: int, kernel: tuple[int, int, int], relu: bool = True) -> None:
        super().__init__()
        self.conv = SubmanifoldConv(in_channels, out_channels, kernel)
        self.norm = NormReLU(out_channels, relu)

    def forward(self, x: SparseTensor) -> SparseTensor:
        """Convolve; the sites stay."""
        y = self.conv(x)
        return y.with_features(self.norm(y.features))


class AsymmetricBlock(nn.Module):
    """Two branches of two flat convolutions, one crossing x first and the other y first, added (Cylinder3D [2, 12]).

    Their windows span a cross in the ground plane, which fits the walls and boxes of streets at two thirds of a
    3 x 3 x 3 convolution's weights (paper, appendix, implementation details).
    """

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.x_first = nn.Sequential(
            ConvUnit(in_channels, out_channels, ACROSS_X), ConvUnit(out_channels, out_channels, ACROSS_Y)
        )
        self.y_first = nn.Sequential(
            ConvUnit(in_channels, out_channels, ACROSS_Y), ConvUnit(out_channels, out_channels, ACROSS_X)
        )

    def forward(self, x: SparseTensor) -> SparseTensor:
        """Convolve; the sites stay."""
        return x.with_features(self.x_first(x).features + self.y_first(x).features)


class ResidualBlock(nn.Module):
    """Two 3 x 3 x 3 convolutions and a short cut (a linear one where the width changes)."""

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.first = ConvUnit(in_channels, out_channels, CUBE)
        self.second = ConvUnit(out_channels, out_channels, CUBE, relu=False)
        same = in_channels == out_channels
        self.shortcut = nn.Identity() if same else nn.Linear(in_channels, out_channels, bias=False)

    def forward(self, x: SparseTensor) -> SparseTensor:
        """Convolve; the sites stay."""
        return x.with_features(F.relu_(self.second(self.first(x)).features + self.shortcut(x.features)))


class Down(nn.Module):
    """Halve the resolution, then a block."""

    def __init__(self, in_channels: int, out_channels: int, kernel: int, block: type[nn.Module]) -> None:
        super().__init__()
        self.conv = StridedConv(in_channels, out_channels, kernel)
        self.norm = NormReLU(out_channels)
        self.block = block(out_channels, out_channels)

    def forward(self, x: SparseTensor) -> SparseTensor:
        """Convolve onto the coarser sites."""
        y = self.conv(x)
        out: SparseTensor = self.block(y.with_features(self.norm(y.features)))
        return out


class Up(nn.Module):
    """Undo the strided convolution of the level, set the encoder's features beside, then a block."""

    def __init__(self, in_channels: int, out_channels: int, kernel: int, block: type[nn.Module]) -> None:
        super().__init__()
        self.conv = InverseConv(in_channels, out_channels, kernel)
        self.norm = NormReLU(out_channels)
        self.block = block(2 * out_channels, out_channels)

    def forward(self, x: SparseTensor, skip: SparseTensor) -> SparseTensor:
        """Convolve back onto the sites of ``skip``."""
        fine = self.norm(self._features(x, skip.sites))
        out: SparseTensor = self.block(skip.with_features(torch.cat([fine, skip.features], 1)))
        return out

    def _features(self, x: SparseTensor, sites: Sites) -> Tensor:
        features: Tensor = self.conv(x, sites).features
        return features
