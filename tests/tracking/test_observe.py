"""What a tracker is told of a sweep's labels, and how its identities come back to the points."""

import math
from dataclasses import replace

import torch

from most.structures import Detections, Panoptic
from most.tracking import observe

CAR, PERSON, ROAD = 1, 6, 9
THINGS = [CAR, PERSON]
POINTS = torch.tensor(
    [[0.0, 0, 0], [2, 0, 0], [1, 3, 1], [10, 0, 0], [12, 0, 0], [5, 5, 0], [6, 6, 0], [7, 7, 0]]
)  # fmt: skip
LABELS = Panoptic(torch.tensor([CAR, CAR, CAR, CAR, CAR, PERSON, CAR, ROAD]), torch.tensor([1, 1, 1, 7, 7, 1, 0, 0]))
FOUND = Detections(
    torch.tensor([PERSON, CAR]), torch.tensor([0.9, 0.4]), torch.tensor([[5.0, 5, 1], [11, 1, 1]]),
    torch.tensor([[0.4, 0.4, 0.9], [2, 1, 0.8]]), torch.tensor([[1.0, 0], [0, -9]]),
)  # fmt: skip


def test_segments_of_others_are_told_by_their_points():
    """Cars 1 and 7 and a person 1; the car without an id, the road, are no segments."""
    segments = observe(POINTS, LABELS, THINGS)
    seen = segments.observations
    assert seen.classes.tolist() == [CAR, CAR, PERSON]
    assert torch.allclose(seen.centres, torch.tensor([[1, 1, 1 / 3], [11, 0, 0], [5, 5, 0]]))
    assert torch.allclose(seen.extents, torch.tensor([[1, 2, 2 / 3], [1, 0.05, 0.05], [0.05, 0.05, 0.05]]))
    assert (seen.velocities.tolist(), seen.velocity_known.tolist()) == ([[0, 0]] * 3, [False] * 3)
    assert seen.scores.tolist() == [0, 0, 0]
    assert segments.rename(torch.tensor([40, 50, 60])).tolist() == [40, 40, 40, 50, 50, 60, 0, 0]


def test_segments_that_a_detection_claims_take_what_it_says():
    """The detected car claims a point of each car, and most of car 7; the detected person claims one of a car's."""
    claimed = torch.tensor([0, -1, -1, 1, -1, -1, 1, -1])
    seen = observe(POINTS, LABELS, THINGS, FOUND, claimed).observations
    assert seen.velocity_known.tolist() == [False, True, False]
    assert torch.equal(seen.centres[1], FOUND.centres[1])
    assert torch.equal(seen.extents[1], FOUND.extents[1])
    assert torch.equal(seen.velocities[1], FOUND.velocities[1])
    assert torch.allclose(seen.scores, torch.tensor([0.0, 0.4, 0.0]))
    assert torch.allclose(seen.centres[0], torch.tensor([1, 1, 1 / 3]))


def test_the_detection_that_claims_most_counts():
    two = Detections.cat([FOUND.select(torch.tensor([1]))] * 2)
    two.scores = torch.tensor([0.8, 0.7])
    claimed = torch.tensor([0, 1, 1, -1, -1, -1, -1, -1])
    assert torch.allclose(observe(POINTS, LABELS, THINGS, two, claimed).observations.scores[0], torch.tensor(0.7))


def test_numbers_of_instances_mean_nothing():
    other = Panoptic(LABELS.semantics, torch.tensor([9, 9, 9, 3, 3, 2**40, 0, 0]))
    claimed = torch.tensor([-1, -1, -1, 1, 1, 0, -1, -1])
    one, two = (observe(POINTS, labels, THINGS, FOUND, claimed) for labels in (LABELS, other))
    order = torch.tensor([1, 0, 2])  # cars 3 and 9, where they were 1 and 7
    for name, value in vars(one.observations).items():
        assert torch.equal(getattr(two.observations.select(order), name), value), name


def test_points_that_are_not_finite_count_for_nothing():
    points = POINTS.clone()
    points[1], points[5] = torch.nan, torch.inf
    seen = observe(points, LABELS, THINGS).observations
    assert torch.allclose(seen.centres, torch.tensor([[0.5, 1.5, 0.5], [11, 0, 0], [0, 0, 0]]))
    assert seen.extents.isfinite().all()
    assert seen.placed.tolist() == [True, True, False]


def test_what_a_detection_claims_is_somewhere_even_without_a_finite_point():
    points = POINTS.clone()
    points[5] = torch.nan
    seen = observe(points, LABELS, THINGS, FOUND, torch.where(LABELS.semantics == PERSON, 0, -1)).observations
    assert seen.placed.all()
    assert torch.equal(seen.centres[2], FOUND.centres[0])


def test_a_sweep_without_things_has_no_segments():
    nothing = observe(POINTS[:0], Panoptic(LABELS.semantics[:0], LABELS.ids[:0]), THINGS, FOUND, LABELS.ids[:0])
    assert (len(nothing.observations), nothing.rename(LABELS.ids[:0]).tolist()) == (0, [])
    road = observe(POINTS[:1], Panoptic(torch.tensor([ROAD]), torch.tensor([3])), THINGS)
    assert (len(road.observations), road.rename(LABELS.ids[:0]).tolist()) == (0, [0])


def test_a_turned_detection_lends_what_it_reaches_along_the_axes():
    claimed = torch.tensor([-1, -1, -1, 1, 1, -1, -1, -1])
    turned = replace(FOUND, yaws=torch.tensor([0.0, math.pi / 2]))
    seen = observe(POINTS, LABELS, THINGS, turned, claimed).observations
    assert torch.allclose(seen.extents[1], torch.tensor([1.0, 2.0, 0.8]), atol=1e-6)
