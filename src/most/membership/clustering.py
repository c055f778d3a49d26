"""The training-free baseline: things are what hangs together, seen from above, and is no larger than its class.

Of recent methods without training, ALPINE (Sautier et al., 3DV 2026) found this hard to beat where semantics are good:
points of a class are joined over gaps as wide as an object of it, and what outgrows the class' box by 1.3 is split.
Both numbers are its; the boxes are the taxonomy's. No centre is asked for.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from most.errors import ConfigError
from most.membership.claims import Claims
from most.membership.clusters import by_class, claims_of
from most.membership.components import components
from most.membership.evidence import Channels, Evidence
from most.membership.roi import RegionOfInterest


@dataclass
class Clustering:
    """How far points are joined, and how large a component may be, both for a box of the class' usual size."""

    link: float = 1.0  # of the box's width
    margin: float = 1.3  # of the box

    needs = None

    def __post_init__(self) -> None:
        if not self.link > 0:
            raise ConfigError(f"membership.link: expected a number above 0, found {self.link}")
        if not self.margin >= 1:
            raise ConfigError(f"membership.margin: expected a number >= 1, found {self.margin}")

    def build(self, channels: Channels) -> "ClassComponents":
        """Make the membership for some classes."""
        return ClassComponents(self, channels.things, np.array(channels.boxes))


@dataclass
class ClassComponents:
    """Connected components of each class."""

    settings: Clustering
    things: list[int]  # class ids
    boxes: Float64[np.ndarray, "things 2"]  # usual length and width, m

    def claim(self, evidence: Evidence, roi: RegionOfInterest, overlap: str) -> Claims:
        """Cluster the points of each class, wherever centres were detected (:class:`most.membership.Membership`)."""
        return claims_of(evidence, by_class(evidence.points, evidence.semantics, self.things, self._group))

    def _group(self, index: int, places: Float64[np.ndarray, "points 3"]) -> Int64[np.ndarray, "points"]:
        box, settings = self.boxes[index], self.settings
        return components(places[:, :2], settings.link * box[1], box, settings.margin)
