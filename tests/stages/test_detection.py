"""Stage 1's wiring: the losses are those of ``most.losses`` on the right inputs, and they lead somewhere."""

from collections import Counter

import lightning as L
import pytest
import torch

from most.detections import PeakDetector
from most.errors import ConfigError
from most.heads import OffsetHead
from most.inference import Inference, Prediction
from most.losses import LossWeights, class_weights, focal_loss, regression_losses, semantic_loss
from most.membership import MeanShift
from most.modal.targets import bev_targets
from most.stages.detection import DetectionStage, DetectionTraining, one_cycle
from most.structures import Detections, Panoptic
from most.voxels import voxelise
from tiny import CAR, ROAD, TAXONOMY, cloud, labelled, street, tiny_predictor, window

COUNTS = torch.arange(TAXONOMY.num_classes) * 100


def stage(parts=None, **settings):
    made = DetectionStage(
        tiny_predictor(**(parts or {})), TAXONOMY, COUNTS, DetectionTraining(**settings), {"most": {"format": 1}}, 1
    )
    made.logged = {}
    made.log_dict = lambda values, **_: made.logged.update(values)
    return made


def void():
    """A window in which nothing is labelled."""
    nothing = torch.zeros(50, dtype=torch.int64)
    return labelled(cloud(50), nothing, nothing)


def test_losses_are_those_of_the_functions_called_by_hand():
    far = torch.tensor([[99.0, 0.0, 0.0]])  # a labelled point that the network does not see
    first = street()
    second = labelled(torch.cat([far, cloud(30)]), torch.tensor([CAR] + [ROAD] * 30), torch.tensor([1] + [0] * 30))
    made = stage(losses=LossWeights(class_balance=0.5))
    output = made.network([first, second])
    losses = made.losses([first, second], output)

    seen = torch.cat([first.semantics, second.semantics[1:]])
    weights = class_weights(COUNTS[1:], 0.5)
    targets = bev_targets(
        [first.instances, second.instances], (-8.0, -8.0), (4.0, 4.0), (4, 4), TAXONOMY.things,
        made.training_settings.targets,
    )  # fmt: skip
    assert torch.equal(losses["point"], semantic_loss(output.point_logits, seen, weights))
    assert torch.equal(losses["heatmap"], focal_loss(output.maps.heatmap, targets.heatmap))
    for name, loss in regression_losses(output.maps, targets).items():
        assert torch.equal(losses[name], loss), name
    assert set(losses) == {"voxel", "point", "heatmap", "offset", "height", "extent", "velocity"}


def test_a_voxel_is_what_most_of_its_current_points_are():
    here = torch.tensor([[0.1, 0.1, 0.1], [0.2, 0.2, 0.2], [0.3, 0.3, 0.3], [5.1, 0.1, 0.1]])
    sample = labelled(here, torch.tensor([ROAD, CAR, CAR, 0]), torch.tensor([0, 1, 1, 0]))
    past = window(here, torch.tensor([[-5.0, 0.0, 0.0]])).points
    sample.points = past  # a voxel of a past sweep has no class
    made = stage()
    output = made.network([sample])
    voxels = voxelise([sample], made.network.grid)
    classes = torch.zeros(len(voxels), dtype=torch.int64)
    classes[voxels.point_voxel[0]] = CAR
    expected = semantic_loss(output.voxel_logits, classes, torch.ones(19))
    assert torch.equal(made.losses([sample], output)["voxel"], expected)


def test_without_any_label_semantics_cost_nothing_and_gradients_are_finite():
    made = stage()
    total = made.training_step([void()], 0)
    assert made.logged["train/loss_voxel"] == made.logged["train/loss_point"] == 0
    assert made.logged["train/loss_offset"] == made.logged["train/loss_extent"] == 0
    total.backward()
    gradients = [weight.grad for weight in made.network.parameters() if weight.grad is not None]
    assert gradients
    assert all(gradient.isfinite().all() for gradient in gradients)


def test_the_total_is_the_weighted_sum():
    weights = LossWeights(
        voxel=2.0, point=3.0, heatmap=5.0, offset=7.0, height=11.0, extent=13.0, velocity=0.0, lovasz=1.5
    )
    made = stage(losses=weights)
    total = made.training_step([street()], 0)
    names = vars(weights).keys() - {"class_balance", "yaw"}  # these boxes have no yaw
    apart = {name: made.logged[f"train/loss_{name}"] for name in names}
    assert total.item() == pytest.approx(sum(getattr(weights, name) * loss.item() for name, loss in apart.items()))
    assert made.logged["train/loss"] == total.detach()
    assert not any(value.requires_grad for value in made.logged.values())


def test_a_network_learns_a_street_and_finds_its_cars():
    made, sample = stage(), street()
    made.predictor.settings = Inference(detector=PeakDetector(threshold=0.3))
    course = learn(made, sample, 30)
    assert course[-1] < course[0] / 3

    made.eval()
    (prediction,) = made.predict_step([sample], 0)
    found = prediction.detections
    assert found.classes.tolist() == [CAR, CAR]
    distance, nearest = (found.centres[:, None] - sample.instances.centres[None]).norm(dim=2).min(1)
    assert distance.max() < 1.0
    assert sorted(nearest.tolist()) == [0, 1]
    votes = Counter(prediction.panoptic.semantics[:80].tolist())
    assert votes[CAR] > 70


def learn(made, sample, steps):
    """Train for some steps; return the losses."""
    settings = DetectionTraining(max_lr=0.05, weight_decay=0.0, epochs=1, batch_size=1)
    optimiser, schedule = one_cycle(made.network.parameters(), settings, steps)
    course = []
    for _ in range(steps):
        optimiser.zero_grad()
        loss = made.training_step([sample], 0)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(made.network.parameters(), settings.clip)
        optimiser.step()
        schedule.step()
        course.append(loss.item())
    return course


def test_an_offset_network_learns_where_its_cars_are():
    made, sample = stage({"centre_head": OffsetHead(8), "membership": MeanShift()}), street()
    assert set(made.losses([sample], made.network([sample]))) == {"voxel", "point", "offset"}
    learn(made, sample, 30)
    made.eval()
    (prediction,) = made.predict_step([sample], 0)
    cars = TAXONOMY.instance_of(sample.labels)[:80]
    assert prediction.panoptic.semantics[:80].eq(CAR).sum() > 70
    votes = Counter(zip(prediction.panoptic.ids[:80].tolist(), cars.tolist(), strict=True)).most_common(2)
    assert {car for (_, car), _ in votes} == {1, 2}
    assert len({ours for (ours, _), _ in votes}) == 2
    assert sum(count for _, count in votes) > 65
    assert prediction.detections.velocities.isnan().all()


def test_the_offset_loss_is_the_distance_over_points_with_an_instance():
    made, first = stage({"centre_head": OffsetHead(8), "membership": MeanShift()}), street()
    far = torch.tensor([[99.0, 0.0, 0.0]])  # of a car that the network does not see
    second = labelled(torch.cat([far, cloud(30)]), torch.tensor([CAR] + [ROAD] * 30), torch.tensor([1] + [0] * 30))
    output = made.network([first, second])
    centres = first.instances.centres[TAXONOMY.instance_of(first.labels)[:80] - 1]
    expected = (first.points[:80, :3] + output.offsets[:80] - centres).abs().sum() / 80
    assert torch.allclose(made.losses([first, second], output)["offset"], expected)
    assert made.losses([void()], made.network([void()]))["offset"] == 0


def perfect(samples):
    """Predicts the truth."""
    return [
        Prediction(
            Panoptic(sample.semantics, TAXONOMY.instance_of(sample.labels)),
            Detections(
                sample.instances.classes, torch.ones(len(sample.instances)), sample.instances.centres,
                sample.instances.extents, sample.instances.velocities,
            ),
            sample.instances.extents + 0.1,
            TAXONOMY.instance_of(sample.labels) - 1,
        )
        for sample in samples
    ]  # fmt: skip


def test_validation_scores_a_split_and_starts_afresh():
    made = stage()
    made.predictor, made.trainer = perfect, L.Trainer(accelerator="cpu", logger=False, enable_checkpointing=False)
    assert len(made.validation_step([street(), street()], 0)["predictions"]) == 2
    made.on_validation_epoch_end()
    assert made.logged["val/pq_stuff_present"] == made.logged["val/membership_accuracy"] == 1
    assert made.report["panoptic"]["per_class"]["road"]["pq"] == 1
    made.on_validation_epoch_end()
    assert made.report["panoptic"]["per_class"]["road"]["tp"] == 0


def test_sweeps_without_a_truth_are_predicted_and_not_scored():
    made = stage().eval()
    assert len(made.validation_step([window(cloud(20))], 0)["predictions"]) == 1
    assert made.scores.sums.sequences == {}


def test_checkpoints_carry_the_description():
    content = {}
    stage().on_save_checkpoint(content)
    assert content["most"] == {"format": 1}


@pytest.mark.parametrize("steps", [*range(1, 12), 100])
@pytest.mark.parametrize("warm_up", [0.1, 0.25, 0.4, 0.5, 0.9])
def test_the_rate_rises_then_falls_over_any_number_of_steps(warm_up, steps):
    settings = DetectionTraining(warm_up=warm_up)
    optimiser, schedule = one_cycle([torch.nn.Parameter(torch.zeros(1))], settings, steps)
    rates = []
    for _ in range(steps):
        rates.append(optimiser.param_groups[0]["lr"])
        optimiser.step()
        schedule.step()
    peak = rates.index(max(rates))
    assert rates[0] == pytest.approx(1e-4)
    assert rates[: peak + 1] == sorted(rates[: peak + 1])
    assert rates[peak:] == sorted(rates[peak:], reverse=True)
    assert rates[peak] <= 1e-3 + 1e-9
    assert steps < 5 or peak == pytest.approx(max(warm_up * steps - 1, 1), abs=1)


def test_adamw_is_a_choice():
    parameters = [torch.nn.Parameter(torch.zeros(1))]
    assert type(one_cycle(parameters, DetectionTraining(optimizer="adamw"), 9)[0]) is torch.optim.AdamW


@pytest.mark.parametrize(
    "wrong",
    [{"optimizer": "sgd"}, {"warm_up": 0.0}, {"warm_up": 1.0}, {"max_lr": 0.0}, {"epochs": 0}, {"weight_decay": -1.0}],
)
def test_impossible_settings_are_refused(wrong):
    with pytest.raises(
        ConfigError, match=rf"stage\.detection\.{next(iter(wrong))}: expected .*found {next(iter(wrong.values()))}"
    ):
        DetectionTraining(**wrong)
