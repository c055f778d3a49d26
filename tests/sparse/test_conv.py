"""Every kind of sparse convolution against dense ones in float64."""

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from most.sparse import KernelMap, Sites, sparse_conv

SHAPE = (7, 6, 5)
KINDS = ["313", "133", "333", "strided2", "strided3", "inverse2", "inverse3"]


def random_sites(batch_size: int, seed: int = 0, density: float = 0.2) -> Sites:
    generator = torch.Generator().manual_seed(seed)
    occupied = torch.rand(batch_size, *SHAPE, generator=generator) < density
    return Sites(occupied.nonzero(), SHAPE, batch_size)


def kernel_map(sites: Sites, kind: str) -> KernelMap:
    if kind.startswith("strided"):
        return sites.strided(int(kind[-1]))
    if kind.startswith("inverse"):
        return sites.strided(int(kind[-1])).inverse
    return sites.submanifold((int(kind[0]), int(kind[1]), int(kind[2])))


def random_weight(kind: str, in_channels: int = 3, out_channels: int = 4) -> Tensor:
    widths = (int(kind[-1]),) * 3 if kind[0] in "si" else tuple(map(int, kind))
    generator = torch.Generator().manual_seed(1)
    return torch.randn(out_channels, *widths, in_channels, generator=generator, dtype=torch.float64)


def dense_conv(features: Tensor, weight: Tensor, maps: KernelMap, kind: str) -> Tensor:
    """The same on dense grids, read at the output's sites."""
    volume = features.new_zeros(maps.inputs.batch_size, *maps.inputs.shape, features.shape[1])
    volume = volume.index_put(maps.inputs.coordinates.unbind(1), features).permute(0, 4, 1, 2, 3)
    if kind.startswith("strided"):
        width = int(kind[-1])
        extra = [side for size in reversed(maps.inputs.shape) for side in (0, size % 2 if width == 2 else 0)]
        out = F.conv3d(F.pad(volume, extra), weight.permute(0, 4, 1, 2, 3), stride=2, padding=width // 3)
    elif kind.startswith("inverse"):
        padding = int(kind[-1]) // 3
        out = F.conv_transpose3d(
            volume, weight.permute(4, 0, 1, 2, 3), stride=2, padding=padding, output_padding=padding
        )
    else:
        out = F.conv3d(volume, weight.permute(0, 4, 1, 2, 3), padding=[int(width) // 2 for width in kind])
    b, x, y, z = maps.outputs.coordinates.unbind(1)
    return out[b, :, x, y, z]


def with_gradients(function, features: Tensor, weight: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    features, weight = features.clone().requires_grad_(), weight.clone().requires_grad_()
    out = function(features, weight)
    direction = torch.linspace(-1, 1, out.numel(), dtype=out.dtype).view_as(out)
    return (out, *torch.autograd.grad((out * direction).sum(), (features, weight)))


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("batch_size", [1, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_equals_dense_convolution(kind: str, batch_size: int, threads: int) -> None:
    maps = kernel_map(random_sites(batch_size), kind)
    features = torch.randn(len(maps.inputs), 3, dtype=torch.float64)
    weight = random_weight(kind)
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        expected = with_gradients(lambda x, w: dense_conv(x, w, maps, kind), features, weight)
        for _ in range(3):
            found = with_gradients(lambda x, w: sparse_conv(x, w, maps), features, weight)
            torch.testing.assert_close(found, expected)
    finally:
        torch.set_num_threads(before)
