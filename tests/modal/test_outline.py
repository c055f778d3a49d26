import math

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from most.modal.outline import hull, join, merge

COORDINATES = st.integers(-40, 40).map(lambda value: value / 8)


def half_sizes(outlines, rows, planar=((1.0, 0.0), (0.0, 1.0)), vertical=1.0):
    return outlines.half_sizes(torch.tensor(rows), torch.tensor(planar, dtype=torch.float64), vertical)


def test_half_sizes_follow_a_turn_exactly():
    # A square with corners on the axes, 1 m from the centre: 45 degrees on, its sides are parallel to the axes.
    outlines = join([np.array([[1.0, 0], [0, 1], [-1, 0], [0, -1]])], [0.5])
    c = math.sqrt(0.5)
    turned = half_sizes(outlines, [0], ((c, -c), (c, c)), -2.0)
    assert torch.allclose(half_sizes(outlines, [0]), torch.tensor([[1.0, 1.0, 0.5]], dtype=torch.float64))
    assert torch.allclose(turned, torch.tensor([[c, c, 1.0]], dtype=torch.float64))


def test_rows_may_come_in_any_order_and_number():
    outlines = join(
        [np.array([[1.0, 2.0]]), np.array([[3.0, 0.0], [0.0, -4.0]]), np.array([[0.0, 5.0]])], [1.0, 2.0, 3.0]
    )
    assert half_sizes(outlines, [2, 0, 1, 2]).tolist() == [[0, 5, 3], [1, 2, 1], [3, 4, 2], [0, 5, 3]]
    assert outlines.half_sizes(torch.zeros(0, dtype=torch.int64), torch.eye(2, dtype=torch.float64), 1.0).shape == (
        0,
        3,
    )


def test_hull_drops_what_lies_inside():
    corners = np.array([[1.0, 1], [1, -1], [-1, -1], [-1, 1]])
    kept = hull(np.concatenate([corners, corners / 2, np.zeros((1, 2))]))
    assert sorted(map(tuple, kept)) == sorted(map(tuple, corners))


def test_hull_of_points_in_a_line_or_one_place():
    line = np.array([[1.0, 2.0], [2.0, 4.0], [-3.0, -6.0], [0.0, 0.0], [0.5, 1.0]])
    assert {(2.0, 4.0), (-3.0, -6.0)} <= set(map(tuple, hull(line)))
    assert len(hull(line)) < len(line)
    assert hull(np.ones((9, 2))).tolist() == [[1, 1]]
    assert hull(np.array([[1.0, 2.0]])).tolist() == [[1, 2]]


@given(arrays(np.float64, st.tuples(st.integers(1, 30), st.just(2)), elements=COORDINATES), st.floats(0, 2 * math.pi))
def test_hull_keeps_the_support_in_every_direction(points, angle):
    direction = np.array([math.cos(angle), math.sin(angle)])
    assert math.isclose((hull(points) @ direction).max(), (points @ direction).max(), abs_tol=1e-9)


def test_merge_lays_the_outlines_of_an_owner_over_one_another():
    outlines = join([np.array([[1.0, 0.0]]), np.array([[9.0, 9.0]]), np.array([[0.0, -2.0]])], [0.5, 7.0, 0.25])
    merged = merge(outlines, np.array([1, 0, 1]), 2)
    assert half_sizes(merged, [0, 1]).tolist() == [[9, 9, 7], [1, 2, 0.5]]


def test_merge_of_nothing():
    assert len(merge(join([], []), np.zeros(0, np.int64), 0)) == 0
