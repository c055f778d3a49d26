"""Which sites a kernel map leads to."""

import pytest
import torch
import torch.nn.functional as F

from most.sparse import Sites

SHAPE = (7, 6, 5)


def test_neighbours_along_a_line() -> None:
    """Three cells in a row along z and one apart: the middle one meets both, the far one none."""
    sites = Sites(torch.tensor([[0, 2, 2, 0], [0, 2, 2, 1], [0, 2, 2, 2], [0, 2, 4, 4]]), SHAPE, 1)
    maps = sites.submanifold((1, 1, 3))
    assert maps.counts == [2, 0, 2]
    assert maps.centre == 1
    assert [rows.tolist() for rows in maps.input_rows] == [[0, 1], [], [1, 2]]
    assert [rows.tolist() for rows in maps.output_rows] == [[1, 2], [], [0, 1]]


def test_the_end_of_an_axis_is_no_neighbour_of_the_next_row() -> None:
    sites = Sites(
        torch.tensor([[0, 0, 5, 0], [0, 1, 0, 0], [0, 4, 2, 4], [0, 4, 3, 0], [0, 6, 5, 4], [1, 0, 0, 0]]), SHAPE, 2
    )
    maps = sites.submanifold((3, 3, 3))
    assert sum(maps.counts) == 0


def test_batches_do_not_meet() -> None:
    sites = Sites(torch.tensor([[0, 3, 3, 3], [1, 3, 3, 4]]), SHAPE, 2)
    assert sum(sites.submanifold((3, 3, 3)).counts) == 0
    assert sites.strided(3).outputs.coordinates[:, 0].unique().tolist() == [0, 1]


def test_two_wide_halvings_tile() -> None:
    """Cells 2 and 3 share the coarse cell 1; the last layer of an odd grid has one of its own."""
    coarse = Sites(torch.tensor([[0, 2, 3, 4], [0, 3, 2, 4], [0, 6, 5, 0]]), SHAPE, 1).strided(2).outputs
    assert coarse.shape == (4, 3, 3)
    assert coarse.coordinates.tolist() == [[0, 1, 1, 2], [0, 3, 2, 0]]


def test_three_wide_halvings_dilate() -> None:
    """An odd cell lies in two windows along an axis, an even one in one."""
    coarse = Sites(torch.tensor([[0, 2, 3, 4]]), SHAPE, 1).strided(3).outputs
    assert coarse.coordinates.tolist() == [[0, 1, 1, 2], [0, 1, 2, 2]]


@pytest.mark.parametrize("kernel", [2, 3])
def test_halvings_reach_what_a_dense_convolution_of_ones_reaches(kernel: int) -> None:
    occupied = torch.rand(2, *SHAPE, generator=torch.Generator().manual_seed(0)) < 0.1
    extra = [side for size in reversed(SHAPE) for side in (0, size % 2 if kernel == 2 else 0)]
    dense = F.pad(occupied[:, None].double(), extra)
    reached = F.conv3d(dense, torch.ones(1, 1, *(kernel,) * 3).double(), stride=2, padding=kernel // 3)[:, 0] > 0
    assert torch.equal(Sites(occupied.nonzero(), SHAPE, 2).strided(kernel).outputs.coordinates, reached.nonzero())


def test_maps_are_shared() -> None:
    sites = Sites(torch.tensor([[0, 2, 3, 4]]), SHAPE, 1)
    assert sites.submanifold((3, 1, 3)) is sites.submanifold((3, 1, 3))
    assert sites.strided(2).inverse is sites.strided(2).inverse
    assert sites.strided(2).inverse.inverse is sites.strided(2)
    assert sites.strided(2).inverse.outputs is sites


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="each site once"):
        Sites(torch.tensor([[0, 1, 1, 1], [0, 1, 1, 1]]), SHAPE, 1)
    sites = Sites(torch.tensor([[0, 2, 3, 4]]), SHAPE, 1)
    with pytest.raises(ValueError, match="widths of 1 or 3"):
        sites.submanifold((3, 2, 3))
    with pytest.raises(ValueError, match="width of 2 or 3"):
        sites.strided(4)


def test_rows_of_cells_in_any_order() -> None:
    coordinates = torch.tensor([[1, 0, 0, 0], [0, 6, 5, 4], [0, 2, 3, 1]])
    asked = torch.tensor([2, 0, 1, 2])
    for order in ([0, 1, 2], [2, 1, 0]):  # the second is that of the keys
        sites = Sites(coordinates[order], SHAPE, 2)
        assert sites.rows(sites.coordinates[asked]).equal(asked)
