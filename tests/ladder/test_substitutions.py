"""Each substitution exchanges what it names, and nothing else."""

from dataclasses import replace

import torch

from most.detections import PeakDetector
from most.ladder import ModelLook
from most.ladder.scene import Scene, Truth, voxel_majority
from most.ladder.substitutions import (
    Peaks,
    centres,
    extents,
    membership,
    point_semantics,
    target_maps,
    velocities,
    voxel_semantics,
)
from most.membership import Pairs, RegionOfInterest
from most.modal.heatmap import HeatmapTargets
from most.structures import Detections, Sample
from tiny import CAR, GRID, PERSON, ROAD, TAXONOMY, labelled, street, tiny_predictor, window


def scene_of(sample: Sample) -> tuple[Scene, Truth]:
    """What an untrained model sees of a sample, and the truth."""
    predictor = tiny_predictor()
    predictor.network.eval()
    assert sample.labels is not None
    assert sample.instances is not None
    with torch.no_grad():
        scene = ModelLook(predictor)(sample, sample.instances)
    return scene, Truth.of(sample, sample.labels, sample.instances, GRID, TAXONOMY)


def detected(scene: Scene, *rows: tuple[int, tuple[float, float, float]], owners: list[int]) -> Scene:
    """The same with detections of extent 3 m and velocity 1 m/s at some places."""
    found = Detections(
        classes=torch.tensor([thing for thing, _ in rows]),
        scores=torch.full((len(rows),), 0.5),
        centres=torch.tensor([place for _, place in rows], dtype=torch.float32),
        extents=torch.full((len(rows), 3), 3.0),
        velocities=torch.ones(len(rows), 2),
    )
    return replace(scene, evidence=replace(scene.evidence, detections=found), owners=torch.tensor(owners))


def test_semantics_are_the_truths_where_it_knows() -> None:
    scene, truth = scene_of(street())
    truth.semantics[:3] = 0
    evidence = point_semantics(scene, truth).evidence
    assert torch.equal(evidence.semantics[3:], truth.semantics[3:])
    assert torch.equal(evidence.semantics[:3], scene.evidence.semantics[:3])
    assert torch.equal(evidence.probabilities[3:].argmax(1) + 1, truth.semantics[3:])
    assert torch.equal(evidence.probabilities[:3], scene.evidence.probabilities[:3])
    assert evidence.detections is scene.evidence.detections


def test_a_voxel_has_one_class_and_points_beyond_the_grid_read_the_nearest() -> None:
    """Voxels of 0.5 m: two car points outvote a person in the first, the unknown one has no vote; then a road."""
    x = torch.tensor([0.1, 0.2, 0.3, 0.4, 5.1, 99.0])
    points = torch.stack([x, torch.full_like(x, 0.1), torch.full_like(x, 0.1)], 1)
    semantics = torch.tensor([CAR, PERSON, CAR, 0, ROAD, PERSON])
    assert voxel_majority(window(points), semantics, GRID, TAXONOMY.num_classes).tolist() == [CAR] * 4 + [ROAD] * 2
    scene, truth = scene_of(street())
    assert torch.equal(voxel_semantics(scene, truth).evidence.semantics, truth.voxel_semantics)


def test_centres_are_the_truths_with_what_the_model_says_in_their_cells() -> None:
    scene, truth = scene_of(street())
    assert scene.maps is not None
    found, owners = centres(scene, truth).evidence.detections, centres(scene, truth).owners
    assert torch.equal(found.centres, truth.instances.centres)
    assert found.scores.tolist() == [1, 1]
    assert owners.tolist() == [0, 1]
    # centres at x, y of about (-4.2, 3.2) and (4.8, -1.4) lie in cells (0, 2) and (3, 1) of 4 m, from -8 m on
    for row, (x, y) in enumerate([(0, 2), (3, 1)]):
        assert torch.allclose(found.extents[row], scene.maps.extent[0, :, x, y].exp())
        assert torch.equal(found.velocities[row], scene.maps.velocity[0, :, x, y])


def test_extents_and_velocities_go_to_detections_that_stand_for_an_instance() -> None:
    scene, truth = scene_of(street())
    scene = detected(scene, (CAR, (0, 0, 0)), (CAR, (4.8, -1.4, -0.9)), owners=[-1, 1])
    truth.instances.velocities[1] = torch.tensor([5.0, 6.0])
    found = extents(scene, truth).evidence.detections
    assert torch.equal(found.extents, torch.stack([torch.full((3,), 3.0), truth.instances.extents[1]]))
    assert torch.equal(found.velocities, scene.evidence.detections.velocities)
    assert velocities(scene, truth).evidence.detections.velocities.tolist() == [[1, 1], [5, 6]]
    truth.instances.velocity_known[1] = False
    assert velocities(scene, truth).evidence.detections.velocities.tolist() == [[1, 1], [1, 1]]


def test_members_are_the_points_of_the_instance_that_a_detection_stands_for() -> None:
    """The street's points 0 to 39 are of the first car, 40 to 79 of the second, the rest of the road."""
    scene, truth = scene_of(street())
    scene = membership(detected(scene, (CAR, (0, 0, 0)), (CAR, (0, 0, 0)), owners=[1, -1]), truth)
    pairs = Pairs(torch.tensor([0, 40, 80, 40]), torch.tensor([0, 0, 0, 1]))
    assert scene.membership(scene.evidence, pairs).tolist() == [0, 1, 0, 0]


def test_peaks_of_the_truths_heat_maps_are_its_centres_but_for_two_in_one_cell() -> None:
    """Persons 1 m apart share a cell of 4 m, and the one with more points is detected."""
    sample = street()
    scene, truth = scene_of(sample)
    peaks = Peaks(PeakDetector(), RegionOfInterest(), TAXONOMY.things, HeatmapTargets())
    seen = peaks(scene, truth)
    found = seen.evidence.detections
    assert sorted(seen.owners.tolist()) == [0, 1]
    assert torch.allclose(found.centres, truth.instances.centres[seen.owners], atol=1e-5)
    assert torch.allclose(found.extents, truth.instances.extents[seen.owners], atol=1e-5)

    places = torch.tensor([[1.0, 1, 0], [1.2, 1, 0], [2.1, 1, 0]])
    crowd = labelled(places, torch.tensor([PERSON] * 3), torch.tensor([1, 1, 2]))
    scene, truth = scene_of(crowd)
    assert peaks(scene, truth).owners.tolist() == [0]
    maps = target_maps(truth.instances, scene.evidence.bev_grid, TAXONOMY.things, HeatmapTargets())
    assert maps.heatmap.sigmoid().max() == 1


def test_peaks_are_those_that_the_network_was_taught() -> None:
    """Cars of 40 points each: a network that was taught those of 41 and more would detect none."""
    scene, truth = scene_of(street())
    for least, found in ((40, 2), (41, 0)):
        peaks = Peaks(PeakDetector(), RegionOfInterest(), TAXONOMY.things, HeatmapTargets(min_points=least))
        assert len(peaks(scene, truth).evidence.detections) == found


def test_extents_come_with_yaws_where_either_knows_them() -> None:
    scene, truth = scene_of(street())
    given = detected(scene, (CAR, (-4.2, 3.2, -0.9)), (CAR, (0.0, 0.0, 0.0)), owners=[0, -1])
    found = given.evidence.detections
    assert extents(given, truth).evidence.detections.yaws is None
    turned = replace(truth, instances=replace(truth.instances, yaws=torch.tensor([0.5, 0.7])))
    assert extents(given, turned).evidence.detections.yaws.tolist() == [0.5, 0.0]
    found.yaws = torch.tensor([1.0, 2.0])
    assert extents(given, truth).evidence.detections.yaws.tolist() == [0.0, 2.0]
    assert found.yaws.tolist() == [1.0, 2.0]
