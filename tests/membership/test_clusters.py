"""Clusterings as memberships: what they detect and claim of a sweep, whatever the network detected."""

import math

import pytest
import torch

from most.errors import ConfigError
from most.membership import Channels, Clustering, Evidence, MeanShift, Membership, RegionOfInterest
from most.panoptic import Fusion, fuse
from most.structures import Detections
from most.tracking import observe
from most.voxels import BevGrid

CAR, PERSON, ROAD = 1, 2, 3
CHANNELS = Channels(classes=3, things=[CAR, PERSON], point=0, bev=0, boxes=[[4.0, 2.0], [0.8, 0.6]])


def evidence(points, semantics, offsets=None, sure=None):
    """A sweep of these points; each is of its class with the probability ``sure``."""
    points = torch.tensor(points).reshape(-1, 3)
    semantics = torch.tensor(semantics, dtype=torch.long)
    probabilities = torch.zeros(len(points), 3)
    if len(points):
        probabilities[range(len(points)), semantics - 1] = torch.tensor(sure or [1.0] * len(points))
    return Evidence(
        points, semantics, probabilities, torch.zeros(len(points), 0), torch.zeros(0, 4, 4),
        BevGrid((0.0, 0.0), (1.0, 1.0), (4, 4)), Detections.none(points),
        None if offsets is None else torch.tensor(offsets).reshape(-1, 3),
    )  # fmt: skip


def claim(settings, *said):
    return settings.build(CHANNELS).claim(evidence(*said), RegionOfInterest(), "confident")


def test_clusterings_are_memberships():
    for settings in (Clustering(), MeanShift()):
        assert isinstance(settings.build(CHANNELS), Membership)


def test_a_component_is_detected_at_its_mean_as_far_as_it_reaches():
    points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [0.5, 0.9, 1.0], [30.0, 0.0, 0.0], [5.0, 5.0, -1.0]]
    found = claim(Clustering(), points, [CAR, CAR, CAR, PERSON, ROAD], None, [0.6, 0.7, 0.8, 0.9, 1.0])
    assert found.claimed.tolist() == [1, 1, 1, 0, -1]  # the surest first
    detected = found.detections
    assert detected.classes.tolist() == [PERSON, CAR]
    assert detected.scores.tolist() == pytest.approx([0.9, 0.7])
    assert detected.centres[1].tolist() == pytest.approx([0.5, 0.3, 0.5])
    assert detected.extents[1].tolist() == pytest.approx([0.5, 0.6, 0.5])
    assert detected.extents[0].tolist() == pytest.approx([0.05] * 3)
    assert detected.velocities.isnan().all()


def test_classes_are_never_joined_and_each_has_its_own_reach():
    points = [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 0.0, 0.0], [1.5, 0.0, 0.0]]
    claimed = claim(Clustering(), points, [CAR, CAR, PERSON, PERSON]).claimed.tolist()
    assert claimed[0] == claimed[1]
    assert len({claimed[0], claimed[2], claimed[3]}) == 3


def test_mean_shift_joins_what_points_vote_for_not_what_is_near():
    points = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.2, 0.0, 0.0], [6.0, 0.0, 0.0]]
    offsets = [[1.5, 0.0, 0.0], [-1.5, 0.0, 0.0], [1.4, 0.0, 0.0], [-1.4, 0.0, 0.0]]
    found = claim(MeanShift(), points, [CAR] * 4, offsets)
    assert found.claimed[0] == found.claimed[1] != found.claimed[2] == found.claimed[3]
    first = found.claimed[0]
    assert found.detections.centres[first].tolist() == pytest.approx([1.5, 0.0, 0.0])  # of the points themselves
    assert found.detections.extents[first].tolist() == pytest.approx([1.5, 0.05, 0.05])


@pytest.mark.parametrize("settings", [Clustering(), MeanShift()])
@pytest.mark.parametrize(("points", "semantics"), [([], []), ([[1.0, 2.0, 3.0]], [ROAD])])
def test_without_things_nothing_is_claimed(settings, points, semantics):
    found = claim(settings, points, semantics, torch.zeros(len(points), 3).tolist())
    assert len(found.detections) == 0
    assert found.claimed.tolist() == [-1] * len(points)


@pytest.mark.parametrize("settings", [Clustering(), MeanShift()])
def test_every_thing_gets_an_id_non_finite_ones_too(settings):
    points = [[0.0, 0.0, 0.0], [math.nan, 0.0, 0.0], [0.1, math.inf, 0.0], [0.0, 0.0, 0.0]]
    seen = evidence(points, [CAR, CAR, CAR, ROAD], torch.zeros(4, 3).tolist())
    fused = fuse(seen, [CAR, PERSON], settings.build(CHANNELS), RegionOfInterest(), Fusion())
    assert fused.claimed.tolist() == [0, -1, -1, -1]
    ids = fused.panoptic.ids.tolist()
    assert (ids[0], ids[3]) == (1, 0)
    assert min(ids[1:3]) > 0


@pytest.mark.parametrize("settings", [Clustering(), MeanShift()])
def test_permuted_points_have_permuted_instances(settings):
    generator = torch.Generator().manual_seed(1)
    points = (torch.rand(60, 3, generator=generator) * 12).tolist()
    semantics = torch.randint(1, 4, (60,), generator=generator).tolist()
    offsets = (torch.rand(60, 3, generator=generator) - 0.5).tolist()
    order = torch.randperm(60, generator=generator).tolist()
    found = claim(settings, points, semantics, offsets)
    again = claim(settings, *([each[row] for row in order] for each in (points, semantics, offsets)))
    assert again.claimed.tolist() == found.claimed[order].tolist()
    assert torch.allclose(again.detections.centres, found.detections.centres)


def test_a_tracker_is_told_that_the_velocity_is_unknown():
    fused = fuse(
        evidence([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [CAR, CAR], None, [0.5, 0.7]), [CAR, PERSON],
        Clustering().build(CHANNELS), RegionOfInterest(), Fusion(),
    )  # fmt: skip
    told = observe(torch.tensor([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), fused.panoptic, [CAR, PERSON], fused.detections,
                   fused.claimed).observations  # fmt: skip
    assert told.velocity_known.tolist() == [False]
    assert told.velocities.tolist() == [[0.0, 0.0]]
    assert told.scores.tolist() == pytest.approx([0.6])


@pytest.mark.parametrize(("wrong", "message"), [({"link": 0.0}, "link"), ({"margin": 0.9}, "margin")])
def test_impossible_settings_are_refused(wrong, message):
    with pytest.raises(ConfigError, match=rf"membership\.{message}: expected .*found {next(iter(wrong.values()))}"):
        Clustering(**wrong)
