"""Membership accuracy: matching and counting, by hand."""

import math

import pytest
import torch
from torch import Tensor

from most.membership import match_detections
from most.metrics import membership
from most.metrics.membership import MembershipCounts, membership_counts
from most.structures import Detections, Instances

CAR, PERSON = 1, 2


def detections(*rows: tuple[int, float, float]) -> Detections:
    """Detections as (class, score, x); everything lies on the x axis."""
    count = len(rows)
    return Detections(
        classes=torch.tensor([row[0] for row in rows], dtype=torch.int64),
        scores=torch.tensor([row[1] for row in rows]),
        centres=on_axis([row[2] for row in rows]),
        extents=torch.ones(count, 3),
        velocities=torch.zeros(count, 2),
    )


def instances(*rows: tuple[int, int, float]) -> Instances:
    """Instances as (key, class, x)."""
    count = len(rows)
    return Instances(
        keys=torch.tensor([row[0] for row in rows], dtype=torch.int64),
        classes=torch.tensor([row[1] for row in rows], dtype=torch.int64),
        counts=torch.ones(count, dtype=torch.int64),
        centres=on_axis([row[2] for row in rows]),
        extents=torch.ones(count, 3),
        velocities=torch.zeros(count, 2),
        velocity_known=torch.zeros(count, dtype=torch.bool),
    )


def on_axis(xs: list[float]) -> Tensor:
    points = torch.zeros(len(xs), 3)
    points[:, 0] = torch.tensor(xs)
    return points


def boxes(*half_sizes: float) -> Tensor:
    return torch.tensor(half_sizes, dtype=torch.float32)[:, None].expand(-1, 3)


def matches(found: Detections, roi: Tensor, truth: Instances) -> list[int]:
    return match_detections(found, roi, truth).tolist()


def test_the_more_confident_detection_chooses_first() -> None:
    found = detections((CAR, 0.5, 0.1), (CAR, 0.9, 0.4))
    assert matches(found, boxes(2, 2), instances((7, CAR, 0.0), (8, CAR, 1.5))) == [1, 0]
    assert matches(found, boxes(2, 2), instances((7, CAR, 0.0))) == [-1, 0]


def test_a_match_needs_the_class_and_a_centre_inside_the_box() -> None:
    truth = instances((7, CAR, 0.0))
    assert matches(detections((PERSON, 0.9, 0.0)), boxes(2), truth) == [-1]
    assert matches(detections((CAR, 0.9, 1.9)), boxes(2), truth) == [0]
    assert matches(detections((CAR, 0.9, 2.0)), boxes(2), truth) == [-1]
    flat = torch.tensor([[2.0, 2.0, 0.1]])
    high = instances((7, CAR, 0.0))
    high.centres[0, 2] = 0.2
    assert matches(detections((CAR, 0.9, 0.0)), flat, high) == [-1]


def test_nothing_to_match() -> None:
    assert matches(detections(), boxes(), instances((7, CAR, 0.0))) == []
    assert matches(detections((CAR, 0.9, 0.0)), boxes(2), instances()) == [-1]


@pytest.fixture
def five_points() -> dict[str, object]:
    """Two cars detected at 0 and 3 m, with boxes that reach 2 m to either side and so overlap between 1 and 2 m.

    x         0      1.5    1.6    3      3.5
    truth     car 7  car 7  car 8  car 8  void
    assigned  0      0      0      1      1
    box       0      0, 1   0, 1   1      1
    """
    return {
        "points": on_axis([0.0, 1.5, 1.6, 3.0, 3.5]),
        "semantics": torch.full((5,), CAR),
        "truth_semantics": torch.tensor([CAR, CAR, CAR, CAR, 0]),
        "truth_labels": torch.tensor([7, 7, 8, 8, 0]),
        "detections": detections((CAR, 0.9, 0.0), (CAR, 0.8, 3.0)),
        "roi": boxes(2, 2),
        "assigned": torch.tensor([0, 0, 0, 1, 1]),
        "truth": instances((7, CAR, 0.1), (8, CAR, 3.1)),
    }


def test_five_points(five_points: dict) -> None:
    """Six pairs; the point at 1.6 m is wrong for both boxes. The two between make four contested pairs, two right."""
    counts = membership_counts(**five_points)
    assert counts == MembershipCounts(correct=4, total=6, contested_correct=2, contested_total=4)
    assert counts.accuracies() == {"membership_accuracy": 4 / 6, "membership_accuracy_contested": 2 / 4}


def test_chunks_change_nothing(five_points: dict, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = membership_counts(**five_points)
    monkeypatch.setattr(membership, "CHUNK", 1)
    assert membership_counts(**five_points) == whole


def test_an_unassigned_point_is_right_only_if_it_is_of_another_instance(five_points: dict) -> None:
    five_points["assigned"] = torch.full((5,), -1)
    counts = membership_counts(**five_points)
    assert counts == MembershipCounts(correct=2, total=6, contested_correct=2, contested_total=4)


def test_points_predicted_as_another_class_are_not_asked(five_points: dict) -> None:
    five_points["semantics"] = torch.tensor([CAR, CAR, PERSON, CAR, CAR])
    assert membership_counts(**five_points) == MembershipCounts(4, 4, 2, 2)


def test_points_of_the_class_without_an_instance_are_left_out_and_other_classes_are_not(five_points: dict) -> None:
    """The last point is a car's without id first, then a person's: assigned to a car, it is wrong."""
    five_points["truth_semantics"] = torch.tensor([CAR, CAR, CAR, CAR, CAR])
    assert membership_counts(**five_points).total == 6
    five_points["truth_semantics"] = torch.tensor([CAR, CAR, CAR, CAR, PERSON])
    assert membership_counts(**five_points) == MembershipCounts(4, 7, 2, 4)


def test_unmatched_detections_neither_count_nor_contest(five_points: dict) -> None:
    five_points["detections"] = detections((CAR, 0.9, 0.0), (CAR, 0.8, 3.0), (CAR, 0.7, 1.5))
    five_points["roi"] = boxes(2, 2, 1)
    assert membership_counts(**five_points) == MembershipCounts(4, 6, 2, 4)


def test_no_detection_gives_no_figure(five_points: dict) -> None:
    five_points |= {"detections": detections(), "roi": boxes(), "assigned": torch.full((5,), -1)}
    counts = membership_counts(**five_points)
    assert counts == MembershipCounts()
    assert all(math.isnan(value) for value in counts.accuracies().values())


def test_counts_add() -> None:
    assert MembershipCounts(1, 2, 3, 4) + MembershipCounts(10, 20, 30, 40) == MembershipCounts(11, 22, 33, 44)


def test_turned_regions_hold_and_match_what_lies_along_them(five_points: dict) -> None:
    """The same five points with regions 0.05 m long and 2 m wide, then turned by a right angle."""
    whole = membership_counts(**five_points)
    five_points["roi"] = torch.tensor([[0.05, 2.0, 2.0]] * 2)
    assert membership_counts(**five_points).total == 0
    five_points["detections"].yaws = torch.full((2,), math.pi / 2)
    assert membership_counts(**five_points) == whole
    five_points["detections"].yaws[0] = 0.0
    assert membership_counts(**five_points).total == 3
