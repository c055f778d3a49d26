"""What holds for every backbone."""

import pytest
import torch

from most.backbones import AsymmetricUNetSettings, AsymmetricUNetSmallSettings, ResidualUNetSettings, UNetSettings
from most.errors import ConfigError
from most.sparse import Sites, SparseTensor

SHAPE = (20, 24, 18)
SETTINGS = [AsymmetricUNetSettings, ResidualUNetSettings, AsymmetricUNetSmallSettings]


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
