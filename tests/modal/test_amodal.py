"""Amodal boxes: whose they are, and that they follow a window exactly."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from most.geometry.boxes import along
from most.modal.amodal import Amodal
from most.modal.boxes import BoxedTable, SequenceBoxes, boxes_of_rows, keys_of_objects
from most.modal.build import LabelRules, build_table
from most.modal.instances import turn
from most.structures import Sweep

CAR, OTHER_CAR, PERSON = 1 | 5 << 16, 1 | 6 << 16, 2 | 8 << 16
EYE, ZERO = torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64)
RULES = LabelRules(lambda raw: raw & 0xFFFF, lambda classes: classes > 0, lambda raw: raw >> 16)
BUMPER = [[8.0, 1.0, 0.0], [8.0, -1.0, 0.4]]  # all that is seen of a car whose middle is at (10, 0, 0.5)


def boxes(*rows, keys=None):
    """Boxes of (frame, object, class, centre, half-sizes, yaw)."""
    frames, objects, classes, centres, halves, yaws = zip(*rows, strict=True) if rows else [[] for _ in range(6)]
    numbers = [torch.tensor(column, dtype=torch.int64) for column in (frames, objects, classes)]
    places = [torch.tensor(column, dtype=torch.float64).reshape(-1, 3) for column in (centres, halves)]
    known = None if keys is None else torch.tensor(keys, dtype=torch.int64)
    return SequenceBoxes(*numbers, known, *places, torch.tensor(yaws, dtype=torch.float64))


def sweep(clouds, index=0, yaw=0.0):
    points = torch.cat([torch.tensor(points, dtype=torch.float64).reshape(-1, 3) for points in clouds.values()])
    labels = torch.cat([torch.full((len(points),), key) for key, points in clouds.items()])
    pose = torch.eye(4, dtype=torch.float64)
    pose[:2, :2] = turn(torch.tensor(yaw, dtype=torch.float64))
    return Sweep("00", index, torch.cat([points, points[:, :1]], 1), pose, index / 10, labels)


def with_boxes(table, found):
    return BoxedTable.of(table, boxes_of_rows(table, found))


def test_a_box_replaces_what_is_seen_and_who_has_none_is_shrink_wrapped():
    """The sensor is turned in the world; its own frame is what counts."""
    table = build_table([sweep({CAR: BUMPER, PERSON: [[1, 2, 3]]}, yaw=1.0)], RULES)
    found = boxes((0, 0, 1, (10.0, 0.0, 0.5), (2.0, 1.0, 0.8), 0.1), keys=[CAR])
    seen = with_boxes(table, found).instances(0, Amodal(), EYE, ZERO)
    assert torch.allclose(seen.centres, torch.tensor([[10.0, 0.0, 0.5], [1.0, 2.0, 3.0]]))
    assert torch.allclose(seen.extents, torch.tensor([[2.0, 1.0, 0.8], [0.05, 0.05, 0.05]]))
    assert torch.allclose(seen.yaws, torch.tensor([0.1, 0.0]), atol=1e-6)
    assert seen.keys.tolist() == [CAR, PERSON]


def test_a_box_without_height_keeps_a_logarithm():
    table = build_table([sweep({CAR: BUMPER})], RULES)
    found = boxes((0, 0, 1, (10.0, 0.0, 0.5), (2.0, 1.0, 0.0), 0.1), keys=[CAR])
    assert with_boxes(table, found).instances(0, Amodal(0.1), EYE, ZERO).extents[0, 2] == pytest.approx(0.1)


@given(
    st.floats(-4.0, 4.0), st.floats(-4.0, 4.0), st.floats(-4.0, 4.0), st.floats(0.5, 2.0),
    st.tuples(st.sampled_from([1.0, -1.0]), st.sampled_from([1.0, -1.0])),
)  # fmt: skip
def test_what_lies_in_a_box_lies_in_it_in_any_window(pose_yaw, box_yaw, angle, scale, flips):
    """Corners of the box are corners of what it becomes, under turns, flips, scale and translation."""
    size = torch.tensor([2.0, 1.0, 0.8], dtype=torch.float64)
    signs = torch.tensor([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)], dtype=torch.float64)
    centre, yaw = torch.tensor([10.0, 0.0, 0.5], dtype=torch.float64), torch.tensor(box_yaw, dtype=torch.float64)
    corners = along(signs * size, -yaw.expand(8)) + centre
    table = build_table([sweep({CAR: BUMPER}, yaw=pose_yaw)], RULES)
    table = with_boxes(table, boxes((0, 0, 1, centre.tolist(), size.tolist(), box_yaw), keys=[CAR]))
    linear = torch.eye(3, dtype=torch.float64)
    linear[:2, :2] = turn(torch.tensor(angle, dtype=torch.float64))
    linear = scale * linear @ torch.diag(torch.tensor([*flips, 1.0], dtype=torch.float64))
    moved = torch.tensor([0.3, -0.7, 0.2], dtype=torch.float64)
    seen = table.instances(0, Amodal(), linear, moved)
    inside = along((corners @ linear.T + moved).float() - seen.centres[0], seen.yaws.expand(8))
    assert torch.allclose(inside.abs(), seen.extents[0].expand(8, 3), atol=1e-4)


def test_boxes_are_told_by_frame_and_key():
    table = build_table([sweep({CAR: BUMPER}), sweep({CAR: BUMPER, OTHER_CAR: [[20, 0, 0]]}, 1)], RULES)
    rows = [(1, 0, 1, (1.0, 0, 0), (1.0, 1, 1), 0.0), (0, 0, 1, (2.0, 0, 0), (1.0, 1, 1), 0.0)]
    found = boxes_of_rows(table, boxes(*rows, keys=[CAR, CAR]))
    assert found.known.tolist() == [True, True, False]
    assert found.centres[:, 0].tolist() == [2.0, 1.0, 0.0]


def test_a_sequence_without_boxes_knows_none():
    table = build_table([sweep({CAR: BUMPER})], RULES)
    assert boxes_of_rows(table, boxes()).known.tolist() == [False]
    assert boxes_of_rows(table, boxes(keys=[])).known.tolist() == [False]


def test_an_object_is_whose_centres_lie_in_its_boxes_even_where_boxes_overlap():
    """In frame 0 both centres lie in the one large box; in frame 1 only the right one does. A person is no car."""
    one, two = [[0.0, 0, 0], [0.2, 0, 0]], [[3.0, 0, 0]]
    table = build_table([sweep({CAR: one, OTHER_CAR: two, PERSON: [[3, 0, 0]]}), sweep({CAR: one}, 1)], RULES)
    large, near, far = ((1.0, 0.0, 0.0), (2.5, 1.0, 1.0), 0.0), ((3.0, 0, 0), (0.2, 0.2, 0.2), 0.0), (9.0, 9.0, 0.0)
    found = boxes((0, 0, 1, *large), (0, 1, 1, *near), (1, 0, 1, *large), (1, 2, 1, far, (1.0, 1.0, 1.0), 0.0))
    assert keys_of_objects(table, found).tolist() == [CAR, OTHER_CAR, -1]
    assert boxes_of_rows(table, found).known.tolist() == [True, True, False, True]


def test_yaws_tell_whether_a_centre_lies_in_a_box():
    table = build_table([sweep({CAR: [[0.0, 3.0, 0.0]]})], RULES)
    for yaw, key in ((0.0, -1), (math.pi / 2, CAR)):
        found = boxes((0, 0, 1, (0.0, 1.0, 0.0), (4.0, 0.5, 1.0), yaw))
        assert keys_of_objects(table, found).tolist() == [key]
