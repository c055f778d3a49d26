import torch

from most.membership import Pairs, pair_targets
from most.structures import Instances

CAR, PERSON, ROAD = 1, 6, 9
TRUTH = Instances(
    keys=torch.tensor([70, 80]),
    classes=torch.tensor([CAR, CAR]),
    counts=torch.tensor([1, 1]),
    centres=torch.zeros(2, 3),
    extents=torch.ones(2, 3),
    velocities=torch.zeros(2, 2),
    velocity_known=torch.zeros(2, dtype=torch.bool),
)
SEMANTICS = torch.tensor([CAR, CAR, ROAD, 0, CAR, PERSON])
LABELS = torch.tensor([70, 80, 40, 0, 10, 30])  # a car without an instance and a person without one, at the end


def targets(*asked: tuple[int, int]) -> list[float | None]:
    """Y_mem of (point, detection), None where unknown; detection 0 stands for car 70, detection 1 for nothing."""
    pairs = Pairs(*torch.tensor(asked).unbind(1))
    classes, matches = torch.tensor([CAR, CAR]), torch.tensor([0, -1])
    values, known = pair_targets(pairs, classes, matches, SEMANTICS, LABELS, TRUTH)
    return [value if told else None for value, told in zip(values.tolist(), known.tolist(), strict=True)]


def test_points_of_the_matched_instance_are_members_and_others_are_not() -> None:
    assert targets((0, 0), (1, 0), (2, 0)) == [1.0, 0.0, 0.0]


def test_a_detection_that_stands_for_nothing_teaches_nothing() -> None:
    assert targets((0, 1), (1, 1), (2, 1)) == [None, None, None]


def test_void_and_points_of_the_class_without_an_instance_are_unknown() -> None:
    assert targets((3, 0), (4, 0), (4, 1)) == [None, None, None]


def test_things_of_another_class_are_no_members_with_or_without_an_instance() -> None:
    assert targets((5, 0)) == [0.0]
