"""The running totals give the figures of the pure functions, over scans and over processes."""

import pytest
import torch
from torch import Tensor

from most.metrics.panoptic import PanopticStatistics, panoptic_figures, panoptic_statistics, per_class
from most.metrics.running import MembershipAccuracy, PanopticQuality
from most.structures import Detections, Instances

NAMES = ["void", "car", "person", "road"]
THINGS = [1, 2]


def scan(seed: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    truth = torch.randint(0, 4, (200,), generator=generator)
    pred = torch.where(
        torch.rand(200, generator=generator) < 0.8, truth, torch.randint(0, 4, (200,), generator=generator)
    )
    return pred, pred + 65536, truth, truth


def together(*seeds: int) -> PanopticStatistics:
    return sum((panoptic_statistics(*scan(seed), 4, 10) for seed in seeds), PanopticStatistics.zeros(4))


def test_panoptic_quality_accumulates_and_resets() -> None:
    metric = PanopticQuality(NAMES, THINGS, min_points=10)
    for seed in (0, 1, 2):
        metric.update(*scan(seed))
    assert metric.compute() == pytest.approx(panoptic_figures(together(0, 1, 2), THINGS))
    assert metric.per_class() == per_class(together(0, 1, 2), NAMES)
    metric.reset()
    metric.update(*scan(3))
    assert metric.compute() == pytest.approx(panoptic_figures(together(3), THINGS))


def test_two_that_saw_half_each_merge_into_one_that_saw_all() -> None:
    one, other = (PanopticQuality(NAMES, THINGS, min_points=10) for _ in range(2))
    one.update(*scan(0))
    other.update(*scan(1))
    one.merge_state(other)
    assert one.compute() == pytest.approx(panoptic_figures(together(0, 1), THINGS))


def test_half_precision_modules_keep_float64_totals() -> None:
    module = torch.nn.Module()
    module.quality = PanopticQuality(NAMES, THINGS, min_points=10)
    module.half()
    module.quality.update(*scan(0))
    assert module.quality.iou_sum.dtype == torch.float64


def test_membership_accuracy_accumulates() -> None:
    metric = MembershipAccuracy()
    detections = Detections(torch.tensor([1]), torch.ones(1), torch.zeros(1, 3), torch.ones(1, 3), torch.zeros(1, 2))
    truth = Instances(
        torch.tensor([7]), torch.tensor([1]), torch.tensor([2]), torch.zeros(1, 3), torch.ones(1, 3),
        torch.zeros(1, 2), torch.zeros(1, dtype=torch.bool),
    )  # fmt: skip
    car, sevens = torch.ones(2, dtype=torch.int64), torch.full((2,), 7)
    for assigned in ([0, 0], [0, -1]):
        metric.update(
            torch.zeros(2, 3), car, car, sevens, detections, torch.ones(1, 3), torch.tensor(assigned), truth
        )  # fmt: skip
    figures = metric.compute()
    assert figures["membership_accuracy"] == 0.75
    assert figures["membership_accuracy_contested"] != figures["membership_accuracy_contested"]  # NaN: none contested
