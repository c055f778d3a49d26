"""Two processes with uneven shares of a batch give the losses and gradients of one process with all of it."""

import itertools
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import Tensor, distributed, multiprocessing

from most.encoder import PointEncoder
from most.membership import Channels, PointSegMLPSettings
from most.stages.detection import DetectionStage, DetectionTraining
from most.stages.membership import MembershipStage, MembershipTraining
from most.structures import Sample
from tiny import TAXONOMY, cloud, labelled, street, tiny_predictor

WORLD = 2
Gradients = dict[str, Tensor]


def shares() -> list[list[Sample]]:
    """A street and a half empty window for the first process; for the second one with a few points of road."""
    road = labelled(cloud(20), torch.full((20,), 9), torch.zeros(20, dtype=torch.long))
    more = street()
    more.points[:, :2] *= 0.7
    more.instances.centres[:, :2] *= 0.7
    return [[street(), more], [road]]


def detection(samples: list[Sample]) -> tuple[DetectionStage, dict[str, Tensor]]:
    predictor = tiny_predictor(encoder=PointEncoder([8, 16, 4]))
    made = DetectionStage(predictor, TAXONOMY, torch.arange(20), DetectionTraining(), {})
    return made, made.losses(samples, made.network(samples))


def membership(samples: list[Sample]) -> tuple[MembershipStage, dict[str, Tensor]]:
    predictor = tiny_predictor(encoder=PointEncoder([8, 16, 4]))
    mlp = PointSegMLPSettings([8, 8]).build(Channels(19, list(TAXONOMY.things), 4, 8))
    made = MembershipStage(predictor, mlp, TAXONOMY, MembershipTraining(), {}).train()
    return made, {"membership": made.loss(predictor.see(samples), samples)}


def gradients(make: Callable, samples: list[Sample]) -> tuple[dict[str, float], Gradients, Gradients]:
    """Losses, gradients, and the statistics that the step left."""
    stage, losses = make(samples)
    sum(losses.values()).backward()
    learned = {name: weight.grad for name, weight in stage.named_parameters() if weight.grad is not None}
    state = {name: value for name, value in stage.state_dict().items() if "running" in name}
    return {name: float(loss) for name, loss in losses.items()}, learned, state


def share(rank: int, make: Callable, folder: Path) -> None:
    """One of the processes: averages gradients as DDP does, and writes what it has."""
    torch.set_num_threads(1)
    distributed.init_process_group("gloo", f"file://{folder / 'meeting'}", rank=rank, world_size=WORLD)
    losses, learned, state = gradients(make, shares()[rank])
    for gradient in learned.values():
        distributed.all_reduce(gradient)
        gradient /= WORLD
    torch.save((losses, learned, state), folder / f"{rank}.pt")
    distributed.destroy_process_group()


@pytest.mark.parametrize("make", [detection, membership])
def test_two_processes_with_uneven_shares_are_one_with_the_whole_batch(make: Callable, tmp_path: Path) -> None:
    losses, learned, state = gradients(make, [*itertools.chain(*shares())])
    multiprocessing.spawn(share, (make, tmp_path), WORLD)
    found = [torch.load(tmp_path / f"{rank}.pt", weights_only=True) for rank in range(WORLD)]
    for name, loss in losses.items():
        assert sum(each[0][name] for each in found) / WORLD == pytest.approx(loss, rel=1e-5), name
    for _, gradient, statistics in found:
        assert gradient.keys() == learned.keys()
        scale = max(float(value.abs().max()) for value in learned.values())
        for name, value in gradient.items():
            torch.testing.assert_close(value, learned[name], atol=1e-5 * scale, rtol=1e-5, msg=name)
        torch.testing.assert_close(statistics, state, atol=1e-6, rtol=1e-5)
