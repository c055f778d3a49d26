"""Stage 1 as a whole: which rows it gives, and that neither company nor order changes them."""

import pytest
import torch

from most.backbones import AsymmetricUNetSettings, AsymmetricUNetSmallSettings, ResidualUNetSettings
from most.heads import OffsetHead
from most.membership import MeanShift
from most.network import is_current
from most.voxels import voxelise
from tiny import GRID, TAXONOMY, cloud, tiny_predictor, window

BACKBONES = [AsymmetricUNetSettings, AsymmetricUNetSmallSettings, ResidualUNetSettings]
CLASSES, THINGS = TAXONOMY.num_classes - 1, len(TAXONOMY.things)


def network(settings=AsymmetricUNetSmallSettings, separate=False, **changes):
    """A network whose batch statistics are those of some points, as after training."""
    backbone = settings(widths=[4, 4, 8, 8], bev_channels=8, separate=separate)
    made = tiny_predictor(backbone=backbone, **changes).network
    made([window(cloud(300))])
    return made.eval()


@pytest.mark.parametrize("settings", BACKBONES)
def test_a_batch_of_windows_with_past_sweeps(settings):
    beyond = torch.tensor([[100.0, 0.0, 0.0], [float("nan"), 0.0, 0.0]])
    samples = [window(torch.cat([beyond, cloud(60)]), cloud(40, 1)), window(cloud(50, 2), cloud(30, 3))]
    output = network(settings)(samples)
    voxels = voxelise(samples, GRID)
    assert output.point_features.shape == (60 + 40 + 50 + 30, 4)
    assert output.voxel_logits.shape == (len(voxels), CLASSES)
    assert output.point_logits.shape == (60 + 50, CLASSES)
    assert output.maps.heatmap.shape == (2, THINGS, 4, 4)
    assert output.maps.extent.shape == (2, 3, 4, 4)
    assert output.bev.shape == (2, 8, 4, 4)
    assert output.point_logits.isfinite().all()


def test_points_of_past_sweeps_have_no_logits():
    samples = [window(cloud(5), cloud(7, 1)), window(cloud(3, 2), cloud(2, 3))]
    output = network()(samples)
    assert output.current.tolist() == [0, 1, 2, 3, 4, 12, 13, 14]
    assert is_current(samples).tolist() == [True] * 5 + [False] * 7 + [True] * 3 + [False] * 2


def test_past_sweeps_are_seen():
    model, here = network(), cloud(50)
    alone, with_past = model([window(here)]), model([window(here, cloud(50, 1))])
    assert not torch.allclose(alone.point_logits, with_past.point_logits)


@pytest.mark.parametrize("settings", BACKBONES)
def test_windows_of_a_batch_do_not_see_each_other(settings):
    model = network(settings)
    first, second = window(cloud(60), cloud(20, 1)), window(cloud(50, 2), cloud(30, 3))
    together, alone = model([first, second]), [model([first]), model([second])]
    for name in ("voxel_logits", "point_logits", "point_features", "bev"):
        apart = torch.cat([getattr(each, name) for each in alone])
        assert torch.allclose(getattr(together, name), apart, atol=1e-5), name
    assert together.maps.yaw is None
    for name in ("heatmap", "offset", "height", "extent", "velocity"):
        value = getattr(together.maps, name)
        assert torch.allclose(value, torch.cat([getattr(each.maps, name) for each in alone]), atol=1e-5), name


@pytest.mark.parametrize("heads", [{}, {"centre_head": OffsetHead(channels=8), "membership": MeanShift()}])
@pytest.mark.parametrize("settings", BACKBONES)
def test_gradients_are_the_same_every_time_on_several_threads(settings, heads):
    made = network(settings, **heads).train()
    samples = [window(cloud(40_000), cloud(20_000, 1))]

    def gradients() -> list[torch.Tensor]:
        output = made(samples)
        found = output.offsets if output.maps is None else output.maps.offset
        total = (output.point_logits.square().sum(1) * torch.linspace(0, 1, 40_000)).sum() + found.square().sum()
        return list(torch.autograd.grad(total, list(made.parameters()), allow_unused=True))

    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        first = gradients()
        for _ in range(3):
            assert all(a is b is None or torch.equal(a, b) for a, b in zip(first, gradients(), strict=True))
    finally:
        torch.set_num_threads(before)


def test_permuted_points_have_permuted_logits():
    model, here, past = network(), cloud(80), cloud(40, 1)
    order = torch.randperm(80, generator=torch.Generator().manual_seed(0))
    logits = model([window(here, past)]).point_logits
    again = model([window(here[order], past.flip(0))]).point_logits
    assert not torch.allclose(logits, again, atol=1e-5)
    assert torch.allclose(logits[order], again, atol=1e-5)


def test_a_voxel_reads_the_map_cell_above_it():
    model = network()
    corners = torch.tensor([[-7.9, -7.9, 0.0], [-7.9, 7.9, 0.0], [7.9, -7.9, 0.0]])
    samples = [window(corners), window(corners)]
    assert model.voxel_cells(voxelise(samples, GRID)).tolist() == [0, 3, 12, 16, 19, 28]
    assert model.bev_grid.cell == (4.0, 4.0)


OFFSETS = {"centre_head": OffsetHead(8), "membership": MeanShift()}


@pytest.mark.parametrize("settings", BACKBONES)
@pytest.mark.parametrize("changes", [{}, OFFSETS], ids=["centres", "offsets"])
def test_separate_networks_share_no_weight(settings, changes):
    model = network(settings, separate=True, **changes).train()
    weights = dict(model.named_parameters())
    for_instances = {name for name in weights if name.startswith(("detection.", "centre_head."))}
    output = model([window(cloud(300)), window(cloud(200, 1))])
    maps = [] if output.maps is None else [each for each in vars(output.maps).values() if each is not None]
    found = torch.cat([each.flatten() for each in maps or [output.offsets]])
    for said, mine in ((found, for_instances), (output.point_logits, weights.keys() - for_instances)):
        model.zero_grad()
        (said**2).sum().backward(retain_graph=True)
        assert {name for name, weight in weights.items() if weight.grad is not None} == mine


def test_separate_networks_are_of_one_kind_but_for_the_decoder():
    alone, apart = network().state_dict(), network(separate=True).state_dict()
    trunk = {name: value.shape for name, value in alone.items() if name.startswith(("encoder.", "backbone."))}
    other = {name.removeprefix("detection."): value.shape for name, value in apart.items() if "detection." in name}
    needless = {name for name in trunk if name.startswith(("backbone.up.", "backbone.bev.back."))}
    assert other == {name: shape for name, shape in trunk.items() if name not in needless}
    assert {name: value.shape for name, value in apart.items() if "detection." not in name} == {
        name: value.shape for name, value in alone.items()
    }


def test_separate_windows_of_a_batch_do_not_see_each_other():
    model = network(separate=True)
    first, second = window(cloud(60), cloud(20, 1)), window(cloud(50, 2), cloud(30, 3))
    together, alone = model([first, second]), [model([first]), model([second])]
    assert torch.allclose(together.bev, torch.cat([each.bev for each in alone]), atol=1e-5)
    assert torch.allclose(together.maps.heatmap, torch.cat([each.maps.heatmap for each in alone]), atol=1e-5)


def test_points_of_a_voxel_vote_for_one_place():
    here = torch.tensor([[0.1, 0.1, 0.1], [0.4, 0.3, 0.2], [5.1, 0.1, 0.1], [90.0, 0.0, 0.0]])
    output = network(**OFFSETS)([window(here, cloud(20))])
    assert output.maps is None
    votes = here[:3] + output.offsets
    assert torch.allclose(votes[0], votes[1], atol=1e-6)
    assert not torch.allclose(votes[0], votes[2], atol=1.0)
    assert (votes[0] - 0.25).norm() < 0.1  # the first weights say little
