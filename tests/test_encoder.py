import math

import torch

from most.encoder import PointEncoder, describe
from most.structures import Sample
from most.voxels import Grid, voxelise

GRID = Grid(voxel_size=[1.0, 1.0, 1.0], lower=[-8.0, -8.0, -4.0], upper=[8.0, 8.0, 4.0])


def window(points):
    return Sample("00", 0, torch.tensor(points), len(points), None, None, None)


def test_voxel_features_are_the_mean_over_its_points():
    points = [[0.2, 0.2, 0.2, 0.0, 0.0], [0.4, 0.4, 0.4, 0.0, 0.0], [3.5, 0.5, 0.5, 0.0, 0.0]]
    network = PointEncoder([8, 4]).build(GRID).eval()
    features, of_voxels = network(torch.tensor(points), voxelise([window(points)], GRID))
    torch.testing.assert_close(of_voxels[:, :4], torch.stack([features[:2].mean(0), features[2]]))


def test_raw_features_of_two_points_worked_out_by_hand():
    points = [[0.25, 0.5, 0.5, 0.3, -0.1], [0.75, 0.5, 0.5, 0.5, 0.0]]
    voxels = voxelise([window(points)], GRID)
    described, raw = describe(torch.tensor(points), voxels, GRID)
    assert torch.allclose(described[0, :3], torch.tensor([0.25 / 8, 0.5 / 8, 0.5 / 4]))
    assert torch.allclose(described[0, 3:5], torch.tensor([0.3, -0.4]))
    assert torch.allclose(described[0, 6:], torch.tensor([-0.25, 0.0, 0.0, -0.25, 0.0, 0.0]))
    assert torch.allclose(raw[0], torch.tensor([0.0, 0.0, 0.0, 0.5, 0.4, -0.2, math.log(2)]))


def test_points_do_not_depend_on_their_order():
    torch.manual_seed(0)
    points = torch.randn(50, 5)
    network = PointEncoder([8, 4]).build(GRID).eval()
    order = torch.randperm(50)
    features, voxel_features = network(points, voxelise([window(points.tolist())], GRID))
    again, voxel_again = network(points[order], voxelise([window(points[order].tolist())], GRID))
    assert torch.allclose(features[order], again, atol=1e-5)
    assert torch.allclose(voxel_features, voxel_again, atol=1e-5)
