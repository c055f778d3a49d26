import math

import torch

from most.membership import Evidence
from most.structures import Detections
from most.voxels import BevGrid


def evidence() -> Evidence:
    """A map of 2 x 3 cells of 2 x 1 m; its feature is 10 x + y of the cell's index."""
    none = torch.zeros(0, 3)
    nothing = Detections(torch.zeros(0, dtype=torch.long), torch.zeros(0), none, none, torch.zeros(0, 2))
    bev = torch.tensor([[[0.0, 1.0, 2.0], [10.0, 11.0, 12.0]]])
    grid = BevGrid((-2.0, 0.0), (2.0, 1.0), (2, 3))
    return Evidence(none, torch.zeros(0, dtype=torch.long), none, none, bev, grid, nothing)


def at(x: float, y: float) -> float:
    return float(evidence().bev_at(torch.tensor([[x, y, 0.0]])))


def test_the_middle_of_a_cell_reads_the_cell() -> None:
    assert math.isclose(at(-1.0, 0.5), 0.0, abs_tol=1e-6)
    assert math.isclose(at(1.0, 2.5), 12.0, rel_tol=1e-6)


def test_between_middles_it_is_interpolated() -> None:
    assert math.isclose(at(0.0, 0.5), 5.0, rel_tol=1e-6)
    assert math.isclose(at(-0.5, 1.25), 2.5 + 0.75, rel_tol=1e-6)


def test_beyond_the_map_its_border_is_read() -> None:
    assert math.isclose(at(99.0, -99.0), 10.0, rel_tol=1e-6)
    assert math.isclose(at(math.inf, 9.0), 12.0, rel_tol=1e-6)
    assert math.isfinite(at(math.nan, math.nan))
