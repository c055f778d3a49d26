"""Regions of interest, and the pairs of points and centres that a membership decides on (paper, section III)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from most.errors import ConfigError
from most.geometry.boxes import along
from most.structures import Detections

CHUNK = 2**24  # point-centre comparisons held in memory at once


@dataclass
class RegionOfInterest:
    """The box about a centre: the predicted extent times ``margin`` plus ``slack`` metres, or Algorithm 1's sphere.

    It is turned as the detection is.
    """

    margin: float = 1.3
    slack: float = 0.3
    sphere: bool = False

    def __post_init__(self) -> None:
        if self.margin <= 0:
            raise ConfigError(f"inference.roi.margin: expected a positive number, found {self.margin}")
        if self.slack < 0:
            raise ConfigError(f"inference.roi.slack: expected metres >= 0, found {self.slack}")

    def half_sizes(self, extents: Float[Tensor, "detections 3"]) -> Float[Tensor, "detections 3"]:
        """Return each region's half-sizes along its own axes, m; a sphere's are all its largest."""
        half = extents * self.margin + self.slack
        return half.amax(1, keepdim=True).expand(-1, 3) if self.sphere else half

    def pairs(
        self,
        points: Float[Tensor, "points 3"],
        semantics: Int64[Tensor, "points"],
        detections: Detections,
        scale: float = 1.0,
    ) -> "Pairs":
        """Return every pair of a point and a centre of its class whose region, grown by ``scale``, holds it."""
        half = self.half_sizes(detections.extents) * scale
        found = [_empty(points.device)]
        for thing in detections.classes.unique().tolist():
            of_class = (semantics == thing).nonzero().squeeze(1)
            centres = (detections.classes == thing).nonzero().squeeze(1)
            for some in of_class.split(max(1, CHUNK // max(1, len(centres)))):
                yaws = None if detections.yaws is None else detections.yaws[centres]
                away = along(points[some][:, None] - detections.centres[centres][None], yaws)
                reached = half[centres][None]
                inside = away.norm(dim=2) < reached[..., 0] if self.sphere else (away.abs() < reached).all(2)
                row, column = inside.nonzero().unbind(1)
                found.append(Pairs(some[row], centres[column]))
        return Pairs(torch.cat([pair.points for pair in found]), torch.cat([pair.detections for pair in found]))


@dataclass
class Pairs:
    """Candidates for membership: row i asks whether point ``points[i]`` belongs to centre ``detections[i]``."""

    points: Int64[Tensor, "pairs"]
    detections: Int64[Tensor, "pairs"]

    def __len__(self) -> int:
        return len(self.points)

    def select(self, keep: Tensor) -> "Pairs":
        """Keep the pairs a boolean mask or an index names."""
        return Pairs(self.points[keep], self.detections[keep])


def _empty(device: torch.device) -> Pairs:
    none = torch.zeros(0, dtype=torch.long, device=device)
    return Pairs(none, none)
