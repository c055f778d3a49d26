import pytest
import torch

from most.heads import CentreHead, OffsetHead, OrientedCentreHead, SemanticHead


def test_maps_have_a_channel_for_each_thing_and_start_at_a_tenth():
    maps = CentreHead(channels=8).build(bev_channels=4, num_things=3)(torch.zeros(2, 4, 6, 5))
    assert maps.heatmap.shape == (2, 3, 6, 5)
    assert torch.allclose(maps.heatmap.sigmoid(), torch.tensor(0.1), atol=1e-3)
    assert [maps.offset.shape[1], maps.height.shape[1], maps.extent.shape[1], maps.velocity.shape[1]] == [2, 1, 3, 2]


def test_offsets_are_of_voxels_and_start_near_zero():
    offsets = OffsetHead(channels=8).build(channels=4, num_things=3)(torch.randn(6, 4))
    assert offsets.shape == (6, 3)
    assert offsets.abs().max() < 0.05


def test_refinement_is_one_linear_layer_over_the_concatenation():
    torch.manual_seed(0)
    head = SemanticHead().build(classes=3, voxel_channels=4, point_channels=2, bev_channels=5)
    voxels, points, bev = torch.randn(6, 4), torch.randn(7, 2), torch.randn(1, 5, 2, 2)
    point_voxel, point_cell = torch.randint(6, (7,)), torch.randint(4, (7,))
    voxel_logits, point_logits = head(voxels, points, bev, point_voxel, point_cell)
    columns = bev[0].flatten(1).T
    joined = torch.cat([voxel_logits[point_voxel], points, columns[point_cell]], 1)
    assert torch.allclose(point_logits, head.point(joined), atol=1e-5)


def test_without_refinement_points_read_their_voxel():
    head = SemanticHead(refine_points=False).build(classes=3, voxel_channels=4, point_channels=2, bev_channels=5)
    index = torch.tensor([1, 1, 0])
    voxel_logits, point_logits = head(torch.randn(2, 4), torch.randn(3, 2), torch.randn(1, 5, 1, 1), index, index * 0)
    assert torch.equal(point_logits, voxel_logits[index])


@pytest.mark.parametrize("refined", [False, True])
def test_gradients_are_the_same_every_time_on_several_threads(refined: bool):
    torch.manual_seed(0)
    head = SemanticHead(refine_points=refined).build(classes=3, voxel_channels=4, point_channels=2, bev_channels=5)
    voxels, points = torch.randn(9, 4, requires_grad=True), torch.randn(200_000, 2)
    bev, direction = torch.randn(1, 5, 3, 3, requires_grad=True), torch.randn(200_000, 3)
    many_to_few = torch.randint(9, (200_000,))

    def gradients() -> list[torch.Tensor]:
        _, point_logits = head(voxels, points, bev, many_to_few, many_to_few)
        return list(torch.autograd.grad((point_logits * direction).sum(), [voxels, bev][: 1 + refined]))

    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        first = gradients()
        assert all(torch.equal(a, b) for _ in range(4) for a, b in zip(first, gradients(), strict=True))
    finally:
        torch.set_num_threads(before)


def test_only_an_oriented_head_has_a_yaw_and_no_more_weights_than_it_needs():
    plain, oriented = (
        kind(channels=8).build(bev_channels=4, num_things=3) for kind in (CentreHead, OrientedCentreHead)
    )
    bev = torch.zeros(2, 4, 6, 5)
    assert plain(bev).yaw is None
    assert oriented(bev).yaw.shape == (2, 2, 6, 5)
    assert (plain.regression.out_channels, oriented.regression.out_channels) == (8, 10)
    assert oriented(bev).velocity.shape == (2, 2, 6, 5)
