"""Sparse convolutions as modules, with the weights' names and layout of spconv."""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from most.sparse.conv import sparse_conv
from most.sparse.kernel_map import KernelMap
from most.sparse.sites import Sites


@dataclass
class SparseTensor:
    """Features of the occupied cells of a batch of grids."""

    features: Float[Tensor, "sites channels"]
    sites: Sites

    def with_features(self, features: Float[Tensor, "sites other"]) -> "SparseTensor":
        """Return other features of the same sites."""
        return SparseTensor(features, self.sites)


class _SparseConvolution(nn.Module):
    """A weight of any kernel, drawn as a dense convolution's would be for the taps that usually meet a site."""

    def __init__(self, in_channels: int, out_channels: int, kernel: tuple[int, int, int], bias: bool) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.empty(out_channels, *kernel, in_channels))
        self.bias = nn.Parameter(torch.zeros(out_channels)) if bias else None
        # Lidar leaves most cells empty: about five taps of a kernel meet a site, however many it has.
        nn.init.normal_(self.weight, std=math.sqrt(2.0 / (min(5, math.prod(kernel)) * in_channels)))

    def _convolve(self, features: Tensor, kernel_map: KernelMap) -> SparseTensor:
        out = sparse_conv(features, self.weight, kernel_map)
        return SparseTensor(out if self.bias is None else out + self.bias, kernel_map.outputs)

    def extra_repr(self) -> str:
        out_channels, *kernel, in_channels = self.weight.shape
        return f"{in_channels}, {out_channels}, kernel={tuple(kernel)}, bias={self.bias is not None}"


class SubmanifoldConv(_SparseConvolution):
    """A convolution that leaves empty cells empty; each width of the kernel is 1 or 3."""

    def __init__(self, in_channels: int, out_channels: int, kernel: tuple[int, int, int], bias: bool = False) -> None:
        super().__init__(in_channels, out_channels, kernel, bias)
        self.kernel = kernel

    def forward(self, x: SparseTensor) -> SparseTensor:
        """Convolve; the sites stay."""
        return self._convolve(x.features, x.sites.submanifold(self.kernel))


class StridedConv(_SparseConvolution):
    """A convolution of stride 2, 2 or 3 wide, onto every coarse cell that it reaches (`Sites.strided`)."""

    def __init__(self, in_channels: int, out_channels: int, kernel: int, bias: bool = False) -> None:
        super().__init__(in_channels, out_channels, (kernel, kernel, kernel), bias)
        self.kernel = kernel

    def forward(self, x: SparseTensor) -> SparseTensor:
        """Convolve onto the coarser sites."""
        return self._convolve(x.features, x.sites.strided(self.kernel))


class InverseConv(_SparseConvolution):
    """The transpose of a strided convolution: back onto the very sites which that one started from."""

    def __init__(self, in_channels: int, out_channels: int, kernel: int, bias: bool = False) -> None:
        super().__init__(in_channels, out_channels, (kernel, kernel, kernel), bias)
        self.kernel = kernel

    def forward(self, x: SparseTensor, sites: Sites) -> SparseTensor:
        """Convolve onto ``sites``, whose strided map must lead to the sites of ``x``."""
        kernel_map = sites.strided(self.kernel).inverse
        if len(kernel_map.inputs) != len(x.features):
            raise ValueError(f"inverse convolution: expected {len(kernel_map.inputs)} sites, found {len(x.features)}")
        return self._convolve(x.features, kernel_map)
