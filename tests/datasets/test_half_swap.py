import math

import torch

from most.datasets.half_swap import OTHER, swap_half
from most.structures import Instances, Sample

CAR, PERSON, ROAD = (3 << 16) | 10, (3 << 16) | 30, 40


def instances(keys: list[int], centres: list[list[float]], counts: list[int]) -> Instances:
    number = len(keys)
    return Instances(
        keys=torch.tensor(keys),
        classes=torch.tensor([1 if key == CAR else 6 for key in keys]),
        counts=torch.tensor(counts),
        centres=torch.tensor(centres).float(),
        extents=torch.full((number, 3), 2.0),
        velocities=torch.zeros(number, 2),
        velocity_known=torch.zeros(number, dtype=torch.bool),
    )


def scan(index: int, rows: list[list[float]], labels: list[int], found: Instances) -> Sample:
    """Points x, y and time; what is not of the current sweep comes last."""
    points = torch.tensor([[x, y, 0.0, index, time] for x, y, time in rows])
    semantics = torch.tensor([{CAR: 1, PERSON: 6, ROAD: 9}[label] for label in labels])
    return Sample("00", index, points, len(labels), torch.tensor(labels), semantics, found)


def test_half_of_the_other_window_takes_the_place_of_ours() -> None:
    """Cut along the x axis (azimuth 0): ours stays to the right (y < 0), the other's comes on the left (y > 0)."""
    ours = scan(
        1,
        [[4, -1, 0], [4, -2, 0], [4, 1, 0], [9, 5, 0], [5, -5, -0.1], [5, 5, -0.1]],
        [CAR, CAR, CAR, PERSON],
        instances([PERSON, CAR], [[9, 5, 0], [4, -0.7, 0]], [1, 3]),
    )
    theirs = scan(
        2,
        [[7, 3, 0], [8, -3, 0], [6, 6, 0], [7, 4, -0.2]],
        [CAR, CAR, ROAD],
        instances([CAR], [[7.5, 0.1, 0]], [2]),
    )
    mixed = swap_half(ours, theirs, 0.0)
    assert (
        mixed.points[:, [0, 1, 3, 4]].tolist()
        == torch.tensor(
            [[4, -1, 1, 0], [4, -2, 1, 0], [7, 3, 2, 0], [6, 6, 2, 0], [5, -5, 1, -0.1], [7, 4, 2, -0.2]]
        ).tolist()
    )
    assert mixed.num_current == 4
    assert mixed.labels.tolist() == [CAR, CAR, CAR + OTHER, ROAD + OTHER]
    assert mixed.semantics.tolist() == [1, 1, 1, 9]
    assert mixed.instances.keys.tolist() == [CAR, CAR + OTHER]
    assert mixed.instances.counts.tolist() == [2, 1]  # of 3 and of 2
    assert mixed.instances.centres.tolist() == torch.tensor([[4, -0.7, 0], [7.5, 0.1, 0]]).tolist()


def test_instance_goes_with_its_centre_or_its_last_point() -> None:
    nothing_left = scan(2, [[4, -4, 0]], [CAR], instances([CAR], [[4, -4, 0]], [1]))
    astride = scan(
        1, [[4, -1, 0], [4, 1, 0]], [CAR, PERSON], instances([CAR, PERSON], [[4, 0.2, 0], [4, -0.1, 0]], [1, 1])
    )
    mixed = swap_half(astride, nothing_left, 0.0)
    assert mixed.semantics.tolist() == [1]  # its centre was cut off; its class is still known
    assert mixed.instances.keys.tolist() == []  # the person's centre stayed, its only point did not


def test_nothing_is_lost_or_doubled_when_a_window_meets_itself() -> None:
    torch.manual_seed(0)
    rows = torch.randn(50, 3).tolist()
    window = scan(1, [[x, y, 0.0] for x, y, _ in rows], [ROAD] * 50, instances([CAR], [[1.0, 0.0, 0.0]], [0]))
    for start in (-math.pi, -1.0, 0.3, 2.0):
        mixed = swap_half(window, window, start)
        assert sorted(mixed.points[:, 0].tolist()) == sorted(window.points[:, 0].tolist())
