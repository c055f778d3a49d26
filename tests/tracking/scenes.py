"""Observations made by hand, and a little world of things that move as they like."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from most.structures import Observations
from most.tracking import Tracker, TrackerSettings

CAR, PERSON = 1, 2
GATES = [0.0, 4.0, 1.0]
OPTIONS = [
    TrackerSettings(),
    TrackerSettings(motion="nearest"),
    TrackerSettings(assignment="hungarian"),
    TrackerSettings(motion="kalman"),
    TrackerSettings(assignment="hungarian", motion="kalman"),
]


def named(settings: TrackerSettings) -> str:
    return f"{settings.assignment}-{settings.motion}"


def tracker(settings: TrackerSettings | None = None, largest: int = 65535, by_class: bool = False) -> Tracker:
    return (settings or TrackerSettings()).build(GATES, largest, by_class)


def seen(*rows: tuple[float, ...], thing: int = CAR, scores: list[float] | None = None) -> Observations:
    """Observations of one class at (x, y), or at (x, y) with a velocity (vx, vy)."""
    full = [[*row, *[float("nan")] * (4 - len(row))] for row in rows]
    table = torch.tensor(full, dtype=torch.float32).reshape(-1, 4)
    known = ~table[:, 2].isnan()
    return Observations(
        classes=torch.full((len(rows),), thing),
        centres=torch.cat([table[:, :2], torch.full((len(rows), 1), -1.0)], 1),
        extents=torch.ones(len(rows), 3),
        velocities=torch.where(known[:, None], table[:, 2:], 0.0),
        velocity_known=known,
        scores=torch.tensor(scores if scores is not None else [0.5] * len(rows)),
        placed=torch.ones_like(known),
    )


def nowhere(count: int, thing: int = CAR) -> Observations:
    """Observations of one class without a finite point."""
    return replace(seen(*[(0, 0)] * count, thing=thing), placed=torch.zeros(count, dtype=torch.bool))


def both(first: Observations, second: Observations) -> Observations:
    return Observations.cat([first, second])


def pose(x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> Tensor:
    """world_from_sensor of a sensor at (x, y), turned left by radians."""
    made = torch.eye(4, dtype=torch.float64)
    cosine, sine = np.cos(turn), np.sin(turn)
    made[:2, :2] = torch.tensor([[cosine, -sine], [sine, cosine]])
    made[:2, 3] = torch.tensor([x, y])
    return made


@dataclass
class World:
    """Things of a fixed velocity, apart from each other by more than a gate and their ways."""

    classes: Tensor
    centres: Tensor  # float64, m, at time 0
    velocities: Tensor  # float64, m/s
    scores: Tensor
    known: Tensor  # whether its velocity is observed

    @staticmethod
    def random(seed: int, count: int = 8) -> "World":
        """A thing in a cell of 30 m each, which it does not leave for seconds."""
        generator = torch.Generator().manual_seed(seed)
        cells = torch.randperm(25, generator=generator)[:count]
        middle = torch.stack([cells // 5 * 30 - 60, cells % 5 * 30 - 60, torch.zeros(count)], 1).double()
        speeds = torch.rand(count, 2, generator=generator, dtype=torch.float64) * 6 - 3
        classes = torch.randint(1, 3, (count,), generator=generator)
        speeds[classes == PERSON] /= 3
        scores = torch.rand(count, generator=generator)
        return World(
            classes, middle, torch.cat([speeds, torch.zeros(count, 1, dtype=torch.float64)], 1), scores, scores > 0.3
        )

    def observed(self, where: Tensor, time: float) -> Observations:
        """All things from a sensor, in their own order."""
        centres = (self.centres + self.velocities * time - where[:3, 3]) @ where[:3, :3]
        return Observations(
            classes=self.classes,
            centres=centres.float(),
            extents=torch.ones(len(self.classes), 3),
            velocities=(self.velocities @ where[:3, :3])[:, :2].float(),
            velocity_known=self.known,
            scores=self.scores,
            placed=torch.ones_like(self.known),
        )
