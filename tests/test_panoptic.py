import torch

from most.membership import Evidence, Nearest, Rating, RegionOfInterest
from most.panoptic import Fusion, cluster, fuse
from most.structures import Detections
from most.voxels import BevGrid

THINGS = [1, 2]


def detections(centres, classes, extent=1.0):
    number = len(classes)
    return Detections(
        torch.tensor(classes, dtype=torch.long), torch.linspace(0.9, 0.5, number),
        torch.tensor(centres).reshape(-1, 3), torch.full((number, 3), extent), torch.zeros(number, 2),
    )  # fmt: skip


def label(points, semantics, found, membership=None, roi=None, **fusion):
    nothing = torch.zeros(len(points), 0)
    evidence = Evidence(
        torch.tensor(points), torch.tensor(semantics), nothing, nothing, torch.zeros(0, 4, 4),
        BevGrid((0.0, 0.0), (1.0, 1.0), (4, 4)), found,
    )  # fmt: skip
    return fuse(
        evidence, THINGS, membership or Nearest(), roi or RegionOfInterest(margin=1.0, slack=0.0), Fusion(**fusion)
    )


class Rated(Rating):
    """A membership that answers from a table (point, detection) -> confidence."""

    def __init__(self, table):
        self.table = table

    def __call__(self, evidence, pairs):
        rows = zip(pairs.points.tolist(), pairs.detections.tolist(), strict=True)
        return torch.tensor([self.table[row] for row in rows])


def test_stuff_has_no_id_and_members_have_their_centres():
    found = detections([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]], [1, 1])
    fused = label([[0.1, 0.0, 0.0], [5.2, 0.0, 0.0], [0.1, 0.0, 0.0]], [1, 1, 9], found)
    assert fused.panoptic.ids.tolist() == [1, 2, 0]
    assert fused.claimed.tolist() == [0, 1, -1]


def test_the_nearest_of_two_centres_wins():
    found = detections([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [1, 1])
    assert label([[0.4, 0.0, 0.0], [0.6, 0.0, 0.0]], [1, 1], found).panoptic.ids.tolist() == [1, 2]


def test_overlaps_go_to_the_most_confident_membership_or_detection():
    found = detections([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [1, 1])
    rated = Rated({(0, 0): 0.6, (0, 1): 0.9})
    assert label([[0.5, 0.0, 0.0]], [1], found, rated).panoptic.ids.tolist() == [2]
    assert label([[0.5, 0.0, 0.0]], [1], found, rated, overlap="order").panoptic.ids.tolist() == [1]


def test_equal_memberships_go_to_the_more_confident_detection():
    found = detections([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [1, 1])
    rated = Rated({(0, 0): 0.9, (0, 1): 0.9})
    assert label([[0.5, 0.0, 0.0]], [1], found, rated).panoptic.ids.tolist() == [1]


def test_a_membership_of_one_half_is_none():
    found = detections([[0.0, 0.0, 0.0]], [1])
    fused = label([[0.5, 0.0, 0.0]], [1], found, Rated({(0, 0): 0.5}), unclaimed="zero")
    assert fused.panoptic.ids.tolist() == [0]


def test_in_several_regions_the_most_confident_has_a_point_however_low_its_confidence_unless_it_is_none():
    found = detections([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [1, 1])
    unsure, surely_not = Rated({(0, 0): 0.1, (0, 1): 0.2}), Rated({(0, 0): 0.0, (0, 1): 0.0})
    point = [[0.5, 0.0, 0.0]]
    assert label(point, [1], found, unsure).claimed.tolist() == [1]
    assert label(point, [1], found, unsure, overlap="order").claimed.tolist() == [-1]  # Algorithm 1, line 10
    assert label(point, [1], found, surely_not).claimed.tolist() == [-1]


def test_unclaimed_points_go_to_a_near_centre_then_to_clusters():
    found = detections([[0.0, 0.0, 0.0]], [1])
    points = [[1.2, 0.0, 0.0], [9.0, 0.0, 0.0], [9.2, 0.0, 0.0], [20.0, 0.0, 0.0], [1.2, 0.0, 0.0]]
    semantics = [1, 1, 1, 1, 2]
    near = label(points, semantics, found)
    assert near.panoptic.ids[0] == 1
    assert near.claimed.tolist() == [-1] * 5
    _, first, second, third, other = near.panoptic.ids.tolist()
    assert first == second
    assert len({1, first, third, other}) == 4
    apart = label(points, semantics, found, unclaimed="cluster").panoptic.ids.tolist()
    assert apart[0] not in (0, 1)
    assert label(points, semantics, found, unclaimed="zero").panoptic.ids.tolist() == [0] * 5


def test_without_detections_things_are_clusters():
    fused = label([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [5.0, 5.0, 0.0]], [1, 1, 9], detections([], []))
    assert fused.panoptic.ids.tolist() == [1, 1, 0]


def test_non_finite_points_get_an_id_too():
    fused = label([[float("nan"), 0.0, 0.0], [0.0, 0.0, 0.0]], [1, 1], detections([[0.0, 0.0, 0.0]], [1]))
    assert fused.panoptic.ids.tolist()[1] == 1
    assert fused.panoptic.ids.tolist()[0] > 1


def test_clusters_keep_classes_apart_and_join_chains():
    points = torch.tensor([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    found = cluster(points, torch.tensor([1, 1, 1, 1, 2]), radius=0.6).tolist()
    assert found[0] == found[1] == found[2]
    assert len({found[0], found[3], found[4]}) == 3
