import math

import pytest
import torch

from most.errors import ConfigError
from most.losses import LossWeights, class_weights, focal_loss, lovasz_loss, regression_losses, semantic_loss
from most.modal.targets import BevTargets
from most.structures import BevMaps


def logit(probability):
    return math.log(probability / (1 - probability))


def test_focal_loss_worked_out_by_hand():
    logits = torch.tensor([logit(0.8), logit(0.3), logit(0.5)], dtype=torch.float64).reshape(1, 1, 1, 3)
    target = torch.tensor([1.0, 0.5, 0.0], dtype=torch.float64).reshape(1, 1, 1, 3)
    expected = -(0.2**2 * math.log(0.8) + 0.5**4 * 0.3**2 * math.log(0.7) + 0.5**2 * math.log(0.5))
    assert focal_loss(logits, target).item() == pytest.approx(expected, rel=1e-5)


def test_focal_loss_without_a_centre_is_finite():
    assert focal_loss(torch.zeros(1, 2, 3, 3), torch.zeros(1, 2, 3, 3)).isfinite()


def test_semantic_loss_ignores_void():
    logits = torch.tensor([[2.0, 0.0], [0.0, 0.0], [5.0, -5.0]])
    loss = semantic_loss(logits, torch.tensor([1, 2, 0]), torch.ones(2))
    expected = (math.log(1 + math.exp(-2)) + math.log(2)) / 2
    assert loss.item() == pytest.approx(expected, rel=1e-6)


def test_semantic_loss_of_nothing_but_void_is_zero():
    assert semantic_loss(torch.ones(2, 3, requires_grad=True), torch.zeros(2, dtype=torch.long), torch.ones(3)) == 0


def test_class_weights_lift_rare_classes_and_average_to_one():
    counts = torch.tensor([900, 100, 0])
    weights = class_weights(counts, 0.5)
    assert weights[1] / weights[0] == pytest.approx(3.0)
    assert weights[2] == 0
    assert (weights[:2] * torch.tensor([0.9, 0.1])).sum() == pytest.approx(1.0)
    assert class_weights(counts, 0.0)[:2].tolist() == [1.0, 1.0]


def test_regression_counts_only_centre_cells_and_known_velocities():
    maps = BevMaps(*[torch.full((1, channels, 2, 2), 9.0) for channels in (1, 2, 1, 3, 2)])
    for value in (maps.offset, maps.height, maps.extent, maps.velocity):
        value[0, :, 0, 1] = 1.0
        value[0, :, 1, 1] = 0.0
    targets = BevTargets(
        heatmap=torch.zeros(1, 1, 2, 2),
        cells=torch.tensor([[0, 0, 1], [0, 1, 1]]),
        offset=torch.tensor([[0.5, 1.0], [0.0, 0.0]]),
        height=torch.tensor([[3.0], [0.0]]),
        extent=torch.zeros(2, 3),
        velocity=torch.tensor([[4.0, 1.0], [7.0, 7.0]]),
        velocity_known=torch.tensor([True, False]),
    )
    losses = {name: loss.item() for name, loss in regression_losses(maps, targets).items()}
    assert losses == pytest.approx({"offset": 0.25, "height": 1.0, "extent": 1.5, "velocity": 3.0})


def test_no_instances_no_regression():
    maps = BevMaps(*[torch.zeros(1, channels, 2, 2) for channels in (1, 2, 1, 3, 2)])
    cells, known = torch.zeros(0, 3, dtype=torch.long), torch.zeros(0, dtype=torch.bool)
    regressed = [torch.zeros(0, channels) for channels in (2, 1, 3, 2)]
    none = BevTargets(torch.zeros(1, 1, 2, 2), cells, *regressed, known)
    assert all(loss == 0 for loss in regression_losses(maps, none).values())


def test_negative_weights_are_refused():
    with pytest.raises(ConfigError, match=r"losses\.extent: expected a number >= 0, found -1"):
        LossWeights(extent=-1.0)


def test_lovasz_of_certain_answers_is_one_minus_mean_iou():
    """Classes 1 2 3 are present, with IoU 1/3, 2/4 and 1; an answer at a void item costs nothing."""
    truth, said = torch.tensor([1, 1, 2, 2, 2, 3, 0]), torch.tensor([1, 2, 2, 2, 1, 3, 1])
    logits = torch.nn.functional.one_hot(said - 1, 4) * 1000.0
    torch.testing.assert_close(lovasz_loss(logits, truth), torch.tensor(1 - (1 / 3 + 2 / 4 + 1) / 3))


def test_lovasz_falls_on_the_way_to_the_truth():
    truth, logits = torch.tensor([1, 1, 2]), torch.zeros(3, 2, dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(lovasz_loss(logits, truth), logits)
    assert (gradient[[0, 1, 2], [0, 0, 1]] < 0).all()
    assert lovasz_loss(logits - gradient, truth) < lovasz_loss(logits, truth)


def test_lovasz_without_a_known_item_is_nothing():
    logits = torch.zeros(3, 2, requires_grad=True)
    loss = lovasz_loss(logits, torch.zeros(3, dtype=torch.long))
    loss.backward()
    assert loss == 0
    assert (logits.grad == 0).all()


def test_yaws_count_where_both_maps_and_targets_have_them():
    """Sine and cosine are off by 0.5 and 1 at one centre, by nothing at the other."""
    maps = BevMaps(*[torch.zeros(1, channels, 2, 2) for channels in (1, 2, 1, 3, 2)])
    cells, known = torch.tensor([[0, 0, 1], [0, 1, 1]]), torch.ones(2, dtype=torch.bool)
    targets = BevTargets(
        torch.zeros(1, 1, 2, 2), cells, *[torch.zeros(2, channels) for channels in (2, 1, 3, 2)], known
    )
    assert "yaw" not in regression_losses(maps, targets)
    targets.yaw = torch.tensor([[0.5, 1.0], [0.0, 0.0]])
    assert "yaw" not in regression_losses(maps, targets)
    maps.yaw = torch.zeros(1, 2, 2, 2)
    assert regression_losses(maps, targets)["yaw"].item() == pytest.approx(0.75)
