"""Components seen from above, and their cuts, against answers worked out by hand and a search over all pairs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from most.membership.components import components, linked, smallest_rectangle

CAR = np.array([4.0, 2.0])


def rectangle(centre, length, width, turn=0.0, step=0.2):
    """Points that fill a rectangle."""
    x, y = np.meshgrid(np.arange(-length / 2, length / 2 + 1e-9, step), np.arange(-width / 2, width / 2 + 1e-9, step))
    cos, sin = np.cos(turn), np.sin(turn)
    return np.stack([x, y], -1).reshape(-1, 2) @ np.array([[cos, sin], [-sin, cos]]) + centre


def label(*parts, radius=1.0, box=CAR, margin=1.3):
    """The set of components that each part's points are in."""
    found = components(np.concatenate(parts), radius, box, margin)
    return [set(each.tolist()) for each in np.split(found, np.cumsum([len(part) for part in parts])[:-1])]


def partition(labels):
    """Which points go together, whatever the numbers."""
    return {frozenset(np.flatnonzero(labels == label).tolist()) for label in np.unique(labels)}


def by_all_pairs(places, radius):
    """Components by joining every pair that is near enough."""
    group = np.arange(len(places))
    for first, second in np.argwhere(np.linalg.norm(places[:, None] - places[None], axis=2) <= radius + 1e-9):
        group[group == group[second]] = group[first]
    return group


def test_two_blobs_are_two_and_a_gap_within_the_radius_is_none():
    near, far = rectangle((0, 0), 1, 1), rectangle((2.5, 0), 1, 1)  # 1.5 m between them
    assert label(near, far) == [{0}, {1}]
    assert label(near, far, radius=1.7) == [{0}, {0}]


def test_a_long_vehicle_of_two_patches_is_one_where_its_class_is_wide():
    front, back = rectangle((0, 0), 3, 2.4), rectangle((5, 0), 3, 2.4)  # 2 m between them, 8 m in all
    assert label(front, back, radius=2.5, box=np.array([7.0, 2.5])) == [{0}, {0}]


def test_what_is_longer_than_its_box_is_cut_at_its_widest_gap():
    first, second = rectangle((0, 0), 4, 2), rectangle((4.5, 0), 4, 2)  # bumpers half a metre apart
    assert label(first, second) == [{0}, {1}]
    assert label(first, second, margin=2.2) == [{0}, {0}]


@pytest.mark.parametrize("turn", [0.0, 0.4, 1.2, 2.5])
def test_neighbours_side_by_side_are_cut_whatever_way_they_stand(turn):
    """They are 0.8 m apart, and all of them together are wider than one is long."""
    beside = 2.6 * np.array([-np.sin(turn), np.cos(turn)])
    cars = [rectangle(index * beside, 4, 1.8, turn) for index in range(3)]
    assert sorted(map(sorted, label(*cars, radius=1.2))) == [[0], [1], [2]]


def test_no_crumb_is_cut_off():
    car, mirror = rectangle((0, 0), 4.4, 1.8, step=0.1), np.array([[2.9, 0.0]])  # the widest gap is at the mirror
    along = rectangle((-4.6, 0), 4.4, 1.8, step=0.1)
    found = label(along, car, mirror, radius=1.0)
    assert found[1] == found[2] != found[0]


def test_a_wall_of_points_comes_apart_in_boxes():
    found = components(rectangle((0, 0), 40, 1.0), 1.0, CAR, 1.3)
    assert 40 / (1.3 * 4) <= found.max() + 1 <= 40 / 2
    for each in partition(found):
        assert smallest_rectangle(rectangle((0, 0), 40, 1.0)[sorted(each)])[1][0] <= 1.3 * 4


def test_one_point_and_points_in_one_place_are_one_component():
    for points in (np.zeros((1, 2)), np.full((5, 2), 3.21)):
        assert components(points, 0.5, CAR, 1.3).tolist() == [0] * len(points)


def test_points_on_a_line_and_very_far_ones_make_no_trouble():
    line = np.stack([np.arange(0, 2, 0.1), np.zeros(20)], 1)
    found = components(np.concatenate([line, [[1e30, -1e30], [2e30, -1e30]]]), 0.5, CAR, 1.3)
    assert found.tolist() == [0] * 20 + [1, 1]


def test_a_turned_rectangle_is_measured_along_itself():
    axes, sides = smallest_rectangle(rectangle((5, 5), 4, 2, 0.5, 0.1))
    assert sides == pytest.approx([4, 2], abs=0.15)  # a cell's corners stand out
    assert abs(axes[0] @ [np.cos(0.5), np.sin(0.5)]) == pytest.approx(1, abs=1e-2)


places = st.lists(st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=1, max_size=40, unique=True)


@settings(max_examples=60, deadline=None)
@given(places, st.sampled_from([0.5, 1.0, 1.5, 2.3, 4.0]))
def test_the_triangulation_links_what_all_pairs_do(cells, radius):
    middles = np.array(cells, dtype=float)
    assert partition(linked(middles, radius)) == partition(by_all_pairs(middles, radius))


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 60))
def test_order_does_not_matter(seed, count):
    rng = np.random.default_rng(seed)
    ground, order = rng.uniform(0, 8, (count, 2)), rng.permutation(count)
    found = components(ground, 0.8, CAR, 1.3)
    assert sorted(set(found.tolist())) == list(range(found.max() + 1))
    assert np.array_equal(components(ground[order], 0.8, CAR, 1.3), found[order])
