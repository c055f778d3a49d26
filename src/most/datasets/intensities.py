"""Intensities as sensors tell them, brought to the [0, 1] that networks are trained with."""

import math
import warnings
from dataclasses import dataclass, field

from jaxtyping import Float32
from torch import Tensor

from most.errors import ConfigError


@dataclass
class IntensityScale:
    """Divides intensities by the sensor's highest; folders and streams share it, so both say the same of a scan."""

    highest: float = 1.0  # 1 as KITTI's, 255 as most sensors' own
    setting: str = "intensity_scale"  # what the user calls ``highest``
    _told: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        if not 0 < self.highest < math.inf:
            raise ConfigError(f"{self.setting}: expected a number > 0, found {self.highest}")

    def repair(self, raw: Float32[Tensor, "points"], source: object) -> Float32[Tensor, "points"]:
        """Return intensities in [0, 1]: those that are not finite become 0, and too bright ones 1.

        The first too bright one is told of, as ``source``'s: the scale is likely another.
        """
        scaled = (raw / self.highest).nan_to_num(0.0, 0.0, 0.0)
        brightest = float(scaled.max()) if len(scaled) else 0.0
        if brightest > 1 and not self._told:
            self._told = True
            warnings.warn(
                f"{source}: expected intensities up to {self.setting}={self.highest:g}, found "
                f"{brightest * self.highest:g}; brighter ones count as 1: give the sensor's highest",
                stacklevel=4,
            )
        return scaled.clamp(0, 1)
