"""A tiny label world: classes 1 and 2 are things, 3 is stuff; a raw label is class + 16 bits of instance."""

import math
from collections.abc import Callable

import pytest
import torch

from most.modal.build import LabelRules
from most.structures import Sweep


@pytest.fixture
def rules() -> LabelRules:
    return LabelRules(
        to_training=lambda raw: (raw & 0xFFFF) % 10,  # raw classes 1 and 11 are both training class 1
        is_thing=lambda classes: (classes == 1) | (classes == 2),
        instance_of=lambda raw: raw >> 16,
    )


@pytest.fixture
def sweep_of() -> Callable[..., Sweep]:
    def make(clouds: dict[int, list | torch.Tensor], index: int = 0, yaw: float = 0.0, at=(0.0, 0.0, 0.0)) -> Sweep:
        """A sweep of {raw label: points}, from a sensor at ``at`` in the world, turned by ``yaw``; ten a second."""
        parts = [torch.as_tensor(points, dtype=torch.float64).reshape(-1, 3) for points in clouds.values()]
        labels = [torch.full((len(part),), raw) for raw, part in zip(clouds, parts, strict=True)]
        xyz = torch.cat([torch.zeros(0, 3, dtype=torch.float64), *parts])
        pose = torch.eye(4, dtype=torch.float64)
        pose[:2, :2] = torch.tensor([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        pose[:3, 3] = torch.tensor(at)
        points = torch.cat([xyz, torch.zeros(len(xyz), 1)], 1)
        return Sweep("00", index, points, pose, index / 10, torch.cat([torch.zeros(0, dtype=torch.int64), *labels]))

    return make
