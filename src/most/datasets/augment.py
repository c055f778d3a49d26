"""Augmentation: one random similarity transform for a whole window; points, centres, extents, velocities follow it."""

import math
from dataclasses import dataclass, field

import numpy as np
import torch

from most.errors import ConfigError
from most.geometry.similarity import Similarity


@dataclass
class Augment:
    """What a window may undergo, in this order: mirror, turn about z, scale, move. The defaults leave it as it is."""

    flip_x: bool = False  # mirror x -> -x, every second time
    flip_y: bool = False
    rotation: float = 0.0  # degrees, uniform within plus and minus this
    scale: list[float] = field(default_factory=lambda: [1.0, 1.0])  # uniform between these two
    translation: float = 0.0  # m, standard deviation along each axis

    def __post_init__(self) -> None:
        if not 0.0 <= self.rotation <= 180.0:
            raise ConfigError(f"augment.rotation: expected degrees in 0..180, found {self.rotation}")
        if len(self.scale) != 2 or not 0.0 < self.scale[0] <= self.scale[1]:
            raise ConfigError(f"augment.scale: expected [lowest, highest], both above 0, found {list(self.scale)}")
        if not self.translation >= 0.0:
            raise ConfigError(f"augment.translation: expected metres >= 0, found {self.translation}")

    def transform(self, rng: np.random.Generator) -> Similarity:
        """Draw one transform; the same numbers are drawn whatever is switched on."""
        mirror = np.where(rng.random(2) < 0.5, [-1.0 if self.flip_x else 1.0, -1.0 if self.flip_y else 1.0], 1.0)
        angle = math.radians(self.rotation) * rng.uniform(-1.0, 1.0)
        scale = rng.uniform(self.scale[0], self.scale[1])
        turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1.0]])
        linear = scale * turn @ np.diag([*mirror, 1.0])
        return Similarity(torch.from_numpy(linear), torch.from_numpy(self.translation * rng.standard_normal(3)))
