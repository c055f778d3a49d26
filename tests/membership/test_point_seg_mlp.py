"""PointSegMLP: what it sees, and that it learns what the nearest centre gets wrong."""

import math
from dataclasses import replace
from typing import Any

import lightning as L
import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from most.errors import ConfigError
from most.inference import Prediction, Predictor
from most.membership import Channels, Evidence, Mixing, Pairs, PointSegMLPSettings, RegionOfInterest
from most.metrics.membership import membership_counts
from most.simulation.scene import Scene
from most.simulation.sensor import directions
from most.simulation.settings import SensorSettings
from most.simulation.vehicles import car
from most.stages.membership import MembershipStage, MembershipTraining
from most.structures import Sample
from tiny import CAR, TAXONOMY, enlighten, known_evidence, labelled, street, tiny_predictor


def touching_cars() -> Sample:
    """One car broadside, the other end-on at its bumper (a T), as a 64-beam lidar 1.7 m above the road sees them."""
    rng = np.random.default_rng(3)
    broadside = car(rng).moved(np.array([0.0, 3.2, -1.7]))
    end_on = car(rng).moved(np.array([3.05, 3.6, -1.7]), np.pi / 2)
    rays = directions(SensorSettings(columns=512), 0.0)
    hits = Scene([broadside, end_on], [1, 2], [1.0, 1.0]).cast(np.zeros(3), rays)
    seen = np.isfinite(hits.distance)
    points = torch.from_numpy(rays[seen] * hits.distance[seen, None]).float()
    instance = torch.from_numpy(hits.label[seen].astype(np.int64))
    return labelled(points, torch.full((len(points),), CAR), instance)


def accuracy(prediction: Prediction, sample: Sample) -> float:
    """Membership accuracy of one sweep."""
    counts = membership_counts(
        sample.points[:, :3], prediction.panoptic.semantics, sample.semantics, sample.labels, prediction.detections,
        prediction.roi, prediction.claimed, sample.instances,
    )  # fmt: skip
    return counts.accuracies()["membership_accuracy"]


def stage(settings: PointSegMLPSettings | None = None, **training: Any) -> MembershipStage:
    predictor = tiny_predictor()
    channels = Channels(TAXONOMY.num_classes - 1, list(TAXONOMY.things), 4, 8)
    torch.manual_seed(0)
    mlp = (settings or PointSegMLPSettings([16, 16])).build(channels)
    return MembershipStage(predictor, mlp, TAXONOMY, MembershipTraining(**training), {})


@pytest.mark.parametrize(("bev", "point"), [(True, True), (True, False), (False, False)])
def test_it_learns_the_border_between_touching_cars_that_the_nearest_centre_gets_wrong(bev: bool, point: bool) -> None:
    sample = touching_cars()
    evidence, made = known_evidence(tiny_predictor(), sample), stage(PointSegMLPSettings([32, 32], bev, point)).train()
    assert accuracy(made.baseline.fuse(evidence), sample) < 0.95
    optimiser = torch.optim.SGD(made.learner.parameters(), lr=0.05, momentum=0.9)
    pairs = made.label(evidence, sample)
    for _ in range(150):
        optimiser.zero_grad()
        made.loss(pairs).backward()
        optimiser.step()
    made.follow()
    made.eval()
    with torch.no_grad():
        assert accuracy(made.predictor.fuse(evidence), sample) >= 0.99


class Knowing(Predictor):
    """Runs stage 1, untrained as it is, and then sees the truth."""

    def see(self, samples: list[Sample]) -> list[Evidence]:
        return list(map(enlighten, super().see(samples), samples))


def test_no_weight_or_statistic_of_stage_1_changes() -> None:
    made, sample = stage(mixing=Mixing(scans=8, steps=3)), touching_cars()
    made.predictor = Knowing(**vars(made.predictor))
    before, mlp = (
        {key: value.clone() for key, value in part.state_dict().items()} for part in (made.network, made.membership)
    )
    trainer = L.Trainer(
        accelerator="cpu", max_epochs=3, logger=False, enable_checkpointing=False, enable_progress_bar=False,
        enable_model_summary=False,
    )  # fmt: skip
    trainer.fit(made, DataLoader([sample], collate_fn=list))
    assert trainer.global_step == 9
    assert any(not torch.equal(value, mlp[key]) for key, value in made.membership.state_dict().items())
    made.train()
    assert not made.network.training
    assert not any(weight.requires_grad or weight.grad is not None for weight in made.network.parameters())
    assert all(torch.equal(value, before[key]) for key, value in made.network.state_dict().items())


@pytest.mark.parametrize(("average", "mean"), [(0.0, 4.0), (0.5, 2.75)])
def test_what_predicts_is_the_running_mean_of_what_is_learned(average: float, mean: float) -> None:
    """Of 1, 2 and 4: the plain mean of the first two, then half of it and half of the last."""
    made = stage(average=average)
    for learned in (1.0, 2.0, 4.0):
        torch.nn.init.constant_(made.learner.out.bias, learned)
        made.follow()
    assert made.membership.out.bias.item() == mean


def test_pairs_do_not_depend_on_each_other_once_trained() -> None:
    sample = touching_cars()
    evidence, mlp = known_evidence(tiny_predictor(), sample), stage().membership.eval()
    pairs = RegionOfInterest().pairs(evidence.points, evidence.semantics, evidence.detections)
    some = torch.randperm(len(pairs), generator=torch.Generator().manual_seed(0))[:100]
    with torch.no_grad():
        torch.testing.assert_close(mlp(evidence, pairs)[some], mlp(evidence, pairs.select(some)))
        confidence = mlp(evidence, pairs)
    assert ((confidence >= 0) & (confidence <= 1)).all()


def test_without_pairs_there_is_nothing_to_rate_or_to_learn() -> None:
    sample = touching_cars()
    evidence, made = known_evidence(tiny_predictor(), sample), stage()
    nothing = replace(evidence, detections=evidence.detections.select(torch.zeros(0, dtype=torch.long)))
    none = Pairs(torch.zeros(0, dtype=torch.long), torch.zeros(0, dtype=torch.long))
    assert len(made.membership(nothing, none)) == 0
    loss = made.loss(made.label(nothing, sample))
    loss.backward()
    assert loss == 0


@pytest.mark.parametrize("widths", [[], [0], [8, -1]])
def test_impossible_widths_are_refused(widths: list[int]) -> None:
    with pytest.raises(ConfigError, match=r"membership\.widths: expected at least one positive width"):
        PointSegMLPSettings(widths)


def test_a_turned_detection_tells_where_along_it_a_point_lies() -> None:
    """Extents 2 and 0.5 m at a right angle: 1 m along y is half of its length."""
    evidence = known_evidence(tiny_predictor(), street())
    found = evidence.detections
    found.extents, found.yaws = torch.tensor([[2.0, 0.5, 1.0]] * 2), torch.tensor([math.pi / 2, 0.0])
    evidence.points = evidence.points.clone()
    evidence.points[0] = found.centres[0] + torch.tensor([0.0, 1.0, 0.0])
    settings = PointSegMLPSettings([4], bev=False, point=False)
    channels = Channels(TAXONOMY.num_classes - 1, list(TAXONOMY.things), 4, 8)
    described = settings.build(channels).describe(evidence, Pairs(torch.tensor([0]), torch.tensor([0])))
    assert described[0, :6].tolist() == pytest.approx([0.0, 1.0, 0.0, 0.5, 0.0, 0.0], abs=1e-5)
