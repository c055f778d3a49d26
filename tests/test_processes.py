"""Two processes with uneven shares of a batch give the losses and gradients of one process with all of it."""

import itertools
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import Tensor, distributed, multiprocessing

from most.encoder import PointEncoder
from most.membership import Channels, Mixing, PointSegMLPSettings
from most.stages.detection import DetectionStage, DetectionTraining
from most.stages.membership import MembershipStage, MembershipTraining
from most.structures import Sample
from tiny import ROAD, TAXONOMY, cloud, known_evidence, labelled, street, tiny_predictor

WORLD = 2
Gradients = dict[str, Tensor]


def shares() -> list[list[Sample]]:
    """A street with two cars and some road for the first process; less than half of that street for the second."""
    road = labelled(cloud(20), torch.full((20,), ROAD), torch.zeros(20, dtype=torch.long))
    whole = street()
    one_car = labelled(whole.points[:100, :3], whole.semantics[:100], (torch.arange(100) < 40).long())
    return [[whole, road], [one_car]]


def detection(samples: list[Sample]) -> tuple[DetectionStage, dict[str, Tensor]]:
    predictor = tiny_predictor(encoder=PointEncoder([8, 16, 4]))
    made = DetectionStage(predictor, TAXONOMY, torch.arange(20), DetectionTraining(), {}, steps=1)
    return made, made.losses(samples, made.network(samples))


def membership(samples: list[Sample], mixing: Mixing | None = None) -> tuple[MembershipStage, dict[str, Tensor]]:
    predictor = tiny_predictor(encoder=PointEncoder([8, 16, 4]))
    mlp = PointSegMLPSettings([8, 8]).build(Channels(19, list(TAXONOMY.things), 4, 8))
    made = MembershipStage(predictor, mlp, TAXONOMY, MembershipTraining(mixing=mixing or Mixing()), {}).train()
    (pairs,) = made.steps([made.label(known_evidence(predictor, sample), sample) for sample in samples])
    return made, {"membership": made.loss(pairs)}


def mixed_membership(samples: list[Sample]) -> tuple[MembershipStage, dict[str, Tensor]]:
    return membership(samples, Mixing(scans=8, steps=1, pairs=10**6))


def gradients(make: Callable, samples: list[Sample]) -> tuple[dict[str, float], Gradients, Gradients]:
    """Losses, gradients, and the statistics that the step left."""
    stage, losses = make(samples)
    sum(losses.values()).backward()
    learned = {name: weight.grad for name, weight in stage.named_parameters() if weight.grad is not None}
    state = {name: value for name, value in stage.state_dict().items() if "running" in name}
    return {name: loss.item() for name, loss in losses.items()}, learned, state


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


@pytest.mark.parametrize("make", [detection, membership, mixed_membership])
def test_two_processes_with_uneven_shares_are_one_with_the_whole_batch(make: Callable, tmp_path: Path) -> None:
    losses, learned, state = gradients(make, [*itertools.chain(*shares())])
    multiprocessing.spawn(share, (make, tmp_path), WORLD)
    found = [torch.load(tmp_path / f"{rank}.pt", weights_only=True) for rank in range(WORLD)]
    for name, loss in losses.items():
        assert loss > 0, name
        assert sum(each[0][name] for each in found) / WORLD == pytest.approx(loss, rel=1e-5), name
    for _, gradient, statistics in found:
        assert gradient.keys() == learned.keys()
        for name, value in gradient.items():
            torch.testing.assert_close(value, learned[name], atol=1e-5, rtol=1e-5, msg=name)
            assert (value - learned[name]).abs().max() <= 1e-4 * learned[name].abs().max(), name  # small ones too
        torch.testing.assert_close(statistics, state, atol=1e-6, rtol=1e-5)
