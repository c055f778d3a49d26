import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from most.errors import ConfigError
from most.structures import Sample
from most.voxels import Grid, nearest_voxel, voxelise

GRID = Grid(voxel_size=[1.0, 1.0, 0.5], lower=[-4.0, -4.0, -1.0], upper=[4.0, 4.0, 1.0])


def sample(*rows):
    points = torch.tensor([[*row, 0.5, 0.0] for row in rows]).reshape(-1, 5)
    return Sample("00", 0, points, len(points), None, None, None)


def test_shape_is_range_over_size():
    assert Grid().shape == (1440, 1440, 32)
    assert GRID.shape == (8, 8, 4)


def test_bev_cells_cover_the_grid_when_it_does_not_divide():
    bev = Grid(voxel_size=[1.0, 1.0, 1.0], lower=[0.0, 0.0, 0.0], upper=[9.0, 16.0, 1.0]).bev(8)
    assert bev.shape == (2, 2)
    assert bev.cell == (8.0, 8.0)


def test_points_share_voxels_and_windows_do_not():
    voxels = voxelise([sample((0.1, 0.1, 0.1), (0.9, 0.9, 0.4)), sample((0.1, 0.1, 0.1))], GRID)
    assert voxels.coordinates.tolist() == [[0, 4, 4, 2], [1, 4, 4, 2]]
    assert voxels.point_voxel.tolist() == [0, 0, 1]


def test_heights_far_beyond_the_grid_are_out_of_range():
    rows = [(0.0, 0.0, 51.0), (0.0, 0.0, -51.0), (0.0, 0.0, 51.1), (0.0, 0.0, -51.1), (0.0, 0.0, 3e38)]
    assert GRID.in_range(sample(*rows).points).tolist() == [True, True, False, False, False]


def test_heights_are_clipped_and_sides_are_not():
    rows = [(0.0, 0.0, -9.0), (0.0, 0.0, 9.0), (4.0, 0.0, 0.0), (0.0, math.nan, 0.0), (-4.0, 0.0, 0.0)]
    voxels = voxelise([sample(*rows)], GRID)
    assert voxels.inputs.tolist() == [0, 1, 4]
    assert voxels.coordinates[voxels.point_voxel].tolist() == [[0, 4, 4, 0], [0, 4, 4, 3], [0, 0, 4, 2]]


def test_a_point_without_a_finite_intensity_is_no_input():
    batch = sample((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    batch.points[0, 3] = math.nan
    assert voxelise([batch], GRID).inputs.tolist() == [1]


def test_a_window_without_points_has_no_voxels():
    assert len(voxelise([sample()], GRID)) == 0


@given(st.lists(st.tuples(*[st.floats(-3.9, 3.9)] * 2, st.floats(-0.9, 0.9)), min_size=1, max_size=20))
def test_every_point_lies_in_its_voxel(rows):
    batch = sample(*rows)
    voxels = voxelise([batch], GRID)
    middles = GRID.middles(voxels.coordinates[:, 1:])[voxels.point_voxel]
    assert ((batch.points[:, :3] - middles).abs() <= torch.tensor([0.5, 0.5, 0.25]) + 1e-5).all()


def test_outside_points_find_the_nearest_voxel():
    cells = torch.tensor([[0, 4, 2], [7, 4, 2], [4, 4, 2]])
    points = torch.tensor([[99.0, 0.0, 0.0], [-99.0, 0.0, 0.0], [math.nan, 0.0, 0.0]])
    assert nearest_voxel(points, cells, GRID).tolist() == [1, 0, 2]


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        ({"voxel_size": [1.0, 1.0]}, "voxel_size"),
        ({"voxel_size": [0.0, 1.0, 1.0]}, "voxel_size"),
        ({"upper": [-60.0, 54.0, 2.4]}, "upper"),
    ],
)
def test_impossible_grids_are_refused(wrong, key):
    with pytest.raises(ConfigError, match=f"grid.{key}: expected"):
        Grid(**wrong)
