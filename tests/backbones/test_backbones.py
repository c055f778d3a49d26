"""What holds for every backbone."""

import math
from functools import partial

import pytest
import torch

from most.backbones import AsymmetricUNetSettings, AsymmetricUNetSmallSettings, ResidualUNetSettings, UNetSettings
from most.backbones.shortcut import Shortcut
from most.errors import ConfigError
from most.sparse import Sites, SparseTensor

SHAPE = (20, 24, 18)
SETTINGS = [
    AsymmetricUNetSettings,
    ResidualUNetSettings,
    AsymmetricUNetSmallSettings,
    partial(AsymmetricUNetSettings, shortcut=True),
    partial(AsymmetricUNetSmallSettings, shortcut=True),
]


def voxels(batch_size: int = 2, density: float = 0.05) -> SparseTensor:
    generator = torch.Generator().manual_seed(0)
    occupied = torch.rand(batch_size, *SHAPE, generator=generator) < density
    sites = Sites(occupied.nonzero(), SHAPE, batch_size)
    return SparseTensor(torch.randn(len(sites), 5, generator=generator), sites)


@pytest.mark.parametrize("settings", SETTINGS)
@pytest.mark.parametrize("density", [0.0, 0.0001, 0.05])
def test_contract(settings: type[UNetSettings], density: float) -> None:
    backbone = settings(widths=[4, 6, 8, 10], bev_channels=7).build(5, SHAPE)
    x = voxels(density=density)
    out = backbone(x)
    assert out.voxels.shape == (len(x.sites), backbone.voxel_channels)
    assert out.bev.shape == (2, backbone.bev_channels, 3, 3)
    assert backbone.bev_stride == 8
    (out.voxels.sum() + out.bev.sum()).backward()
    assert all(p.grad is not None and p.grad.isfinite().all() for p in backbone.parameters())
    assert all(b.isfinite().all() for b in backbone.buffers())


@pytest.mark.parametrize("settings", SETTINGS)
def test_half_precision_is_close_and_trains_whole_weights(settings: type[UNetSettings]) -> None:
    backbone = settings(widths=[4, 6, 8, 10], bev_channels=7).build(5, SHAPE).eval()
    exact = backbone(voxels()).bev
    with torch.autocast("cpu", dtype=torch.bfloat16):
        rough = backbone(voxels()).bev
    assert 0 < (rough.float() - exact).abs().max() < 0.1 * exact.abs().max()
    rough.float().sum().backward()
    gradients = [p.grad for p in backbone.parameters() if p.grad is not None]
    assert gradients
    assert all(gradient.dtype == torch.float32 and gradient.isfinite().all() for gradient in gradients)


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        ({"widths": [1, 2]}, "widths"),
        ({"block": "dense"}, "block"),
        ({"down_kernel": 4}, "down_kernel"),
        ({"bev_channels": 0}, "bev_channels"),
    ],
)
def test_settings_name_what_is_wrong(wrong: dict, key: str) -> None:
    with pytest.raises(ConfigError, match=f"backbone.{key}: expected"):
        UNetSettings(**wrong)


@pytest.mark.parametrize("settings", SETTINGS)
def test_samples_of_a_batch_do_not_touch(settings: type[UNetSettings]) -> None:
    """In evaluation, where batch statistics play no part, each sample comes out as it does alone."""
    backbone = settings(widths=[4, 6, 8, 10], bev_channels=7).build(5, SHAPE).double().eval()
    both = voxels()
    features = both.features.double()
    out = backbone(both.with_features(features))
    for sample in range(2):
        mine = both.sites.coordinates[:, 0] == sample
        coordinates = both.sites.coordinates[mine] * torch.tensor([0, 1, 1, 1])
        alone = backbone(SparseTensor(features[mine], Sites(coordinates, SHAPE, 1)))
        torch.testing.assert_close(out.voxels[mine], alone.voxels)
        torch.testing.assert_close(out.bev[sample], alone.bev[0])


@pytest.mark.parametrize("squeeze", [False, True])
def test_bev_map_is_indexed_by_x_then_y(squeeze: bool) -> None:
    """One voxel lights up the cell it is in and those that two 3 x 3 convolutions reach, and no other."""
    shape = (80, 64, 8)
    settings = UNetSettings(widths=[2, 2, 2, 2], bev_channels=4, bev_squeeze=squeeze, down_kernel=2)
    backbone = settings.build(3, shape).eval()
    for parameter in backbone.parameters():
        parameter.data.abs_()  # no ReLU cuts anything off
    here = SparseTensor(torch.ones(1, 3), Sites(torch.tensor([[0, 8 * 7 + 3, 8 * 2 + 1, 5]]), shape, 1))
    nothing = SparseTensor(torch.zeros(0, 3), Sites(torch.zeros(0, 4, dtype=torch.int64), shape, 1))
    lit = ((backbone(here).bev - backbone(nothing).bev).abs().amax((0, 1)) > 0).nonzero()
    assert lit.tolist() == [[x, y] for x in range(5, 10) for y in range(5)]


def test_evaluation_repeats_itself_and_training_moves_the_statistics() -> None:
    backbone = UNetSettings(widths=[4, 4, 4, 4], bev_channels=4).build(5, SHAPE)
    before = backbone.stem.x_first[0].norm.running_mean.clone()
    backbone(voxels())
    assert not torch.equal(before, backbone.stem.x_first[0].norm.running_mean)
    backbone.eval()
    assert torch.equal(backbone(voxels()).voxels, backbone(voxels()).voxels)


def test_a_shortcut_adds_what_a_layer_makes_of_the_mean_and_the_number_of_the_inputs() -> None:
    """Two voxels below cell (1, 0, 0) of the bottleneck, one below (0, 0, 1), none below (0, 0, 0)."""
    fine = Sites(torch.tensor([[0, 0, 0, 8], [0, 8, 0, 7], [0, 15, 7, 0]]), (16, 8, 16), 1)
    coarse = Sites(torch.tensor([[0, 0, 0, 0], [0, 0, 0, 1], [0, 1, 0, 0]]), (2, 1, 2), 1)
    shortcut = Shortcut(1, 2).eval()
    with torch.no_grad():
        shortcut.linear.weight.copy_(torch.tensor([[1.0, 0.0], [0.0, 1.0]]))
    bottleneck = SparseTensor(torch.full((3, 2), 10.0), coarse)
    out = shortcut(bottleneck, SparseTensor(torch.tensor([[7.0], [2.0], [4.0]]), fine), stride=8)
    expected = torch.tensor([[10.0, 10.0], [17.0, 10.0], [13.0, 10.0 + math.log(2)]])
    torch.testing.assert_close(out.features, expected, rtol=1e-5, atol=1e-4)
