"""The offset head's targets."""

import torch

from most.modal.offsets import centre_offsets
from tiny import CAR, ROAD, labelled


def test_points_point_at_their_own_instances_centre_and_others_nowhere():
    points = torch.tensor([[0.0, 0.0, 0.0], [2.0, 0.0, 1.0], [9.0, 0.0, 0.0], [7.0, 2.0, 0.0], [5.0, 5.0, 5.0]])
    sample = labelled(points, torch.tensor([CAR, CAR, CAR, CAR, ROAD]), torch.tensor([7, 7, 3, 3, 0]))
    shuffled = sample.instances.select(torch.tensor([1, 0]))
    for instances in (sample.instances, shuffled):
        offsets, known = centre_offsets(points, sample.labels, instances)
        assert known.tolist() == [True] * 4 + [False]
        assert (points + offsets)[:4].tolist() == [[1.0, 0.0, 0.5]] * 2 + [[8.0, 1.0, 0.0]] * 2
        assert offsets[4].tolist() == [0.0, 0.0, 0.0]


def test_without_instances_nothing_is_known():
    points = torch.zeros(3, 3)
    sample = labelled(points, torch.tensor([ROAD, CAR, 0]), torch.tensor([0, 0, 0]))
    offsets, known = centre_offsets(points, sample.labels, sample.instances)
    assert not known.any()
    assert not offsets.any()
