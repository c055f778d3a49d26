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


@pytest.mark.parametrize("kind", KINDS)
def test_many_small_blocks_give_the_same(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    sites, weight = random_sites(2), random_weight(kind)
    whole = kernel_map(sites, kind)
    features = torch.randn(len(whole.inputs), 3, dtype=torch.float64)
    expected = with_gradients(lambda x, w: sparse_conv(x, w, whole), features, weight)
    monkeypatch.setattr("most.sparse.blocks.PAIRS_PER_BLOCK", 7)
    cut = kernel_map(random_sites(2), kind)
    found = with_gradients(lambda x, w: sparse_conv(x, w, cut), features, weight)
    assert len(cut.blocks) > len(whole.blocks)
    torch.testing.assert_close(found, expected)


@pytest.mark.parametrize("kind", KINDS)
def test_gradients_by_differences(kind: str) -> None:
    maps = kernel_map(random_sites(1, density=0.03), kind)
    features = torch.randn(len(maps.inputs), 2, dtype=torch.float64, requires_grad=True)
    weight = random_weight(kind, 2, 2).requires_grad_()
    assert torch.autograd.gradcheck(lambda x, w: sparse_conv(x, w, maps), (features, weight))


@pytest.mark.parametrize("kind", KINDS)
def test_no_voxel_gives_none(kind: str) -> None:
    maps = kernel_map(Sites(torch.zeros(0, 4, dtype=torch.int64), SHAPE, 2), kind)
    out, by_features, by_weight = with_gradients(
        lambda x, w: sparse_conv(x, w, maps), torch.zeros(0, 3, dtype=torch.float64), random_weight(kind)
    )
    assert out.shape == (0, 4)
    assert by_features.shape == (0, 3)
    assert not by_weight.any()


@pytest.mark.parametrize("corner", [(0, 0, 0), (6, 5, 4)])
@pytest.mark.parametrize("kind", KINDS)
def test_one_voxel_in_a_corner(kind: str, corner: tuple[int, int, int]) -> None:
    maps = kernel_map(Sites(torch.tensor([[0, *corner]]), SHAPE, 1), kind)
    features = torch.randn(len(maps.inputs), 3, dtype=torch.float64)
    weight = random_weight(kind)
    expected = with_gradients(lambda x, w: dense_conv(x, w, maps, kind), features, weight)
    torch.testing.assert_close(with_gradients(lambda x, w: sparse_conv(x, w, maps), features, weight), expected)


@pytest.mark.parametrize("kind", KINDS)
def test_permuted_rows_give_the_permuted_result(kind: str) -> None:
    sites = random_sites(2)
    mixed = torch.randperm(len(sites), generator=torch.Generator().manual_seed(2))
    shuffled = Sites(sites.coordinates[mixed], SHAPE, 2)
    straight, maps = kernel_map(sites, kind), kernel_map(shuffled, kind)
    into = mixed if straight.inputs is sites else slice(None)
    out_of = mixed if straight.outputs is sites else slice(None)
    features = torch.randn(len(straight.inputs), 3, dtype=torch.float64)
    direction = torch.randn(len(straight.outputs), 4, dtype=torch.float64)

    def run(maps: KernelMap, features: Tensor, direction: Tensor) -> tuple[Tensor, ...]:
        features, weight = features.clone().requires_grad_(), random_weight(kind).requires_grad_()
        out = sparse_conv(features, weight, maps)
        return (out, *torch.autograd.grad((out * direction).sum(), (features, weight)))

    expected = run(straight, features, direction)
    found = run(maps, features[into], direction[out_of])
    torch.testing.assert_close(found, (expected[0][out_of], expected[1][into], expected[2]))


@pytest.mark.parametrize("kind", ["313", "strided3", "inverse3"])
def test_autocast_convolves_in_its_type_and_returns_gradients_in_the_parameters(kind: str) -> None:
    maps = kernel_map(random_sites(1), kind)
    features = torch.randn(len(maps.inputs), 3)
    weight = random_weight(kind).float()
    expected = with_gradients(lambda x, w: sparse_conv(x, w, maps), features, weight)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        found = with_gradients(lambda x, w: sparse_conv(x, w, maps), features, weight)
    assert [t.dtype for t in found] == [torch.bfloat16, torch.float32, torch.float32]
    for mine, theirs in zip(found, expected, strict=True):
        assert (mine.float() - theirs).norm() < 0.05 * theirs.norm()


def test_a_gradient_that_is_no_leaf_layout_is_taken() -> None:
    """A sum's gradient is one number expanded: no memory layout that a matrix product would take."""
    maps = kernel_map(random_sites(1), "313")
    features = torch.randn(len(maps.inputs), 3, dtype=torch.float64, requires_grad=True)
    sparse_conv(features, random_weight("313"), maps).sum().backward()
    assert features.grad is not None
