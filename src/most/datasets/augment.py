"""Augmentation: what a window may undergo. Points, centres, extents and velocities follow one transform."""

import math
from dataclasses import dataclass, field

import numpy as np
import torch

from most.errors import ConfigError
from most.geometry.similarity import Similarity


@dataclass
class Augment:
    """What a window may undergo, in this order: mirror, turn about z, scale, move; brighten; share its ground with
    another window. The defaults leave it as it is.
    """

    flip_x: bool = False  # mirror x -> -x, every second time
    flip_y: bool = False
    rotation: float = 0.0  # degrees, uniform within plus and minus this
    scale: list[float] = field(default_factory=lambda: [1.0, 1.0])  # uniform between these two
    translation: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # m, standard deviations along x, y, z
    intensity: float = 0.0  # share by which intensities rise or fall together, uniform within plus and minus this
    half_swap: float = 0.0  # share of windows that get half of their azimuths from another one

    def __post_init__(self) -> None:
        if not 0.0 <= self.rotation <= 180.0:
            raise ConfigError(f"augment.rotation: expected degrees in 0..180, found {self.rotation}")
        if len(self.scale) != 2 or not 0.0 < self.scale[0] <= self.scale[1]:
            raise ConfigError(f"augment.scale: expected [lowest, highest], both above 0, found {list(self.scale)}")
        if len(self.translation) != 3 or not all(sigma >= 0.0 for sigma in self.translation):
            raise ConfigError(f"augment.translation: expected [x, y, z] in metres >= 0, found {list(self.translation)}")
        for name in ("intensity", "half_swap"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ConfigError(f"augment.{name}: expected a share in 0..1, found {getattr(self, name)}")

    def transform(self, rng: np.random.Generator) -> Similarity:
        """Draw one transform; the same numbers are drawn whatever is switched on."""
        mirror = np.where(rng.random(2) < 0.5, [-1.0 if self.flip_x else 1.0, -1.0 if self.flip_y else 1.0], 1.0)
        angle = math.radians(self.rotation) * rng.uniform(-1.0, 1.0)
        scale = rng.uniform(self.scale[0], self.scale[1])
        turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1.0]])
        linear = scale * turn @ np.diag([*mirror, 1.0])
        return Similarity(torch.from_numpy(linear), torch.from_numpy(self.translation * rng.standard_normal(3)))

    def brightness(self, rng: np.random.Generator) -> float:
        """Draw the factor of a window's intensities."""
        return 1.0 + self.intensity * rng.uniform(-1.0, 1.0)

    def swaps(self, rng: np.random.Generator) -> bool:
        """Draw whether a window gets a half of another one."""
        return bool(rng.random() < self.half_swap)
