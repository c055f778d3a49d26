"""Turned boxes: into their axes, and how far they reach along those of the world."""

import math
from itertools import product

import torch
from hypothesis import given
from hypothesis import strategies as st

from most.geometry.boxes import along, bounds

EIGHTH = math.pi / 4


def test_a_place_ahead_of_a_turned_box_lies_along_it():
    away = torch.tensor([[1.0, 1.0, 0.5], [-1.0, 1.0, 0.0]])
    turned = along(away, torch.full((2,), EIGHTH))
    assert torch.allclose(turned, torch.tensor([[math.sqrt(2), 0.0, 0.5], [0.0, math.sqrt(2), 0.0]]), atol=1e-6)


def test_yaws_are_those_of_the_last_rows():
    away = torch.tensor([[[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
    turned = along(away, torch.tensor([0.0, math.pi / 2]))
    assert torch.allclose(turned, torch.tensor([[[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]]), atol=1e-6)


def test_without_yaws_nothing_is_touched():
    away = torch.rand(3, 3)
    assert along(away, None) is away
    assert bounds(away, None) is away


@given(st.floats(-7.0, 7.0), st.lists(st.floats(0.1, 9.0), min_size=3, max_size=3))
def test_bounds_are_those_of_the_corners(yaw, sizes):
    signs = torch.tensor(list(product((-1.0, 1.0), repeat=3)), dtype=torch.float64)
    size, angle = torch.tensor([sizes], dtype=torch.float64), torch.tensor([yaw], dtype=torch.float64)
    corners = along(signs * size, -angle)  # out of the box's axes again
    assert torch.allclose(bounds(size, angle)[0], corners.abs().amax(0))
