import math
from dataclasses import replace

import torch

from most.membership import RegionOfInterest
from most.structures import Detections


def detections(centres, extents, classes):
    number = len(classes)
    return Detections(
        torch.tensor(classes), torch.linspace(0.9, 0.5, number), torch.tensor(centres), torch.tensor(extents),
        torch.zeros(number, 2),
    )  # fmt: skip


ONE = detections([[0.0, 0.0, 0.0]], [[2.0, 1.0, 1.0]], [1])
POINTS = torch.tensor([[2.5, 0.0, 0.0], [0.0, 1.7, 0.0], [0.0, 0.0, 0.0]])


def test_the_box_is_extent_times_margin_plus_slack():
    pairs = RegionOfInterest(margin=1.2, slack=0.2).pairs(POINTS, torch.tensor([1, 1, 1]), ONE)
    assert sorted(pairs.points.tolist()) == [0, 2]  # 2.5 < 2.6 along x, 1.7 > 1.4 along y


def test_points_of_another_class_are_no_candidates():
    assert RegionOfInterest().pairs(POINTS, torch.tensor([2, 1, 2]), ONE).points.tolist() == []


def test_a_sphere_has_the_largest_half_size_as_radius():
    pairs = RegionOfInterest(margin=1.0, slack=0.0, sphere=True).pairs(POINTS, torch.tensor([1, 1, 1]), ONE)
    assert sorted(pairs.points.tolist()) == [1, 2]


def test_a_point_in_two_regions_makes_two_pairs():
    two = detections([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]], [[2.0, 1.0, 1.0]] * 2, [1, 1])
    pairs = RegionOfInterest().pairs(torch.tensor([[1.5, 0.0, 0.0]]), torch.tensor([1]), two)
    assert sorted(zip(pairs.points.tolist(), pairs.detections.tolist(), strict=True)) == [(0, 0), (0, 1)]


def test_chunks_find_what_the_whole_finds(monkeypatch):
    torch.manual_seed(0)
    points, semantics = torch.randn(100, 3) * 3, torch.randint(1, 3, (100,))
    many = detections(torch.randn(7, 3).tolist(), [[1.0, 1.0, 1.0]] * 7, [1, 2, 1, 1, 2, 2, 1])
    whole = RegionOfInterest().pairs(points, semantics, many)
    monkeypatch.setattr("most.membership.roi.CHUNK", 8)
    parts = RegionOfInterest().pairs(points, semantics, many)
    assert set(zip(*[value.tolist() for value in vars(whole).values()], strict=True)) == set(
        zip(*[value.tolist() for value in vars(parts).values()], strict=True)
    )
    assert len(whole) == len(parts)


def test_a_region_is_turned_as_its_detection_is():
    """A box 4 m long at 45 degrees: what lies ahead of it is in, what lies as far beside it is not."""
    turned = replace(ONE, yaws=torch.tensor([math.pi / 4]))
    points = torch.tensor([[1.3, 1.3, 0.0], [1.3, -1.3, 0.0], [1.9, 0.0, 0.0]])
    roi = RegionOfInterest(margin=1.0, slack=0.0)
    assert roi.pairs(points, torch.tensor([1, 1, 1]), turned).points.tolist() == [0]
    assert roi.pairs(points, torch.tensor([1, 1, 1]), ONE).points.tolist() == [2]


def test_each_of_several_regions_has_its_own_turn():
    two = detections([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]], [[2.0, 0.5, 1.0]] * 2, [1, 2])
    two.yaws = torch.tensor([0.0, math.pi / 2])
    points = torch.tensor([[1.5, 0.0, 0.0], [9.0, 1.5, 0.0], [0.0, 1.5, 0.0], [10.5, 0.0, 0.0]])
    pairs = RegionOfInterest(margin=1.0, slack=0.0).pairs(points, torch.tensor([1, 2, 1, 2]), two)
    assert list(zip(pairs.points.tolist(), pairs.detections.tolist(), strict=True)) == [(0, 0), (1, 1)]
