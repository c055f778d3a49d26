"""From detection maps to modal centres: peaks, decoding, and suppression of weaker centres in the same object."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor
from torch.nn import functional as F

from most.errors import ConfigError
from most.geometry.boxes import along, bounds
from most.structures import BevMaps, Detections
from most.voxels import BevGrid


@dataclass
class PeakDetector:
    """Non-maximum suppression over the heat maps (paper, section III, inference)."""

    window: int = 3  # cells to a side within which a peak must be the highest
    threshold: float = 0.15
    most: int = 200  # detections a sweep
    overlap: float = 0.5  # a weaker centre inside this share of a same-class box goes; 0 keeps all

    def __post_init__(self) -> None:
        if self.window < 1 or self.window % 2 == 0:
            raise ConfigError(f"inference.detector.window: expected an odd number of cells, found {self.window}")
        if not 0 <= self.threshold < 1:
            raise ConfigError(f"inference.detector.threshold: expected a number in [0, 1), found {self.threshold}")
        if self.most < 1:
            raise ConfigError(f"inference.detector.most: expected at least one detection, found {self.most}")
        if self.overlap < 0:
            raise ConfigError(f"inference.detector.overlap: expected a number >= 0, found {self.overlap}")

    def __call__(self, maps: BevMaps, things: list[int], grid: BevGrid) -> list[Detections]:
        """Return the detections of each window of a batch; ``things`` are the class ids of the heat map's channels."""
        thing_ids = torch.tensor(things, device=maps.heatmap.device)
        return [self._detect(_window(maps, index), thing_ids, grid) for index in range(len(maps.heatmap))]

    def _detect(self, maps: BevMaps, thing_ids: Tensor, grid: BevGrid) -> Detections:
        """Pick the peaks of one window's maps."""
        heat = maps.heatmap[0].float().sigmoid()
        highest = F.max_pool2d(heat[None], self.window, stride=1, padding=self.window // 2)[0]
        peaks = torch.where((heat == highest) & (heat > self.threshold), heat, 0.0)
        scores, place = peaks.flatten().topk(min(self.most, peaks.numel()))
        scores, place = scores[scores > 0], place[scores > 0]
        _, width, depth = heat.shape
        channel, x, y = place // (width * depth), place // depth % width, place % depth
        found = Detections(thing_ids[channel], scores, *decode(maps, x, y, grid))
        return found.select(self._kept(found))

    def _kept(self, found: Detections) -> Bool[Tensor, "detections"]:
        """Greedily drop each centre that lies inside a more confident one of its class (boxes seen from above)."""
        distance = along(found.centres[:, None] - found.centres[None], found.yaws)[..., :2].abs()
        reach = self.overlap * torch.maximum(_in_axes_of_each(found)[..., :2], found.extents[None, :, :2])
        covers = (distance < reach).all(2) & (found.classes[:, None] == found.classes[None])
        covered_by = covers.cpu().tril(-1)
        kept = torch.ones(len(found), dtype=torch.bool)
        for weaker in range(1, len(found)):
            kept[weaker] = not (covered_by[weaker] & kept).any()
        return kept.to(found.scores.device)


def _in_axes_of_each(found: Detections) -> Float[Tensor, "detections detections 3"]:
    """Return the half-sizes of box i along the axes of box j, m."""
    count = len(found)
    if found.yaws is None:
        return found.extents[:, None].expand(-1, count, -1)
    turns = (found.yaws[:, None] - found.yaws[None]).flatten()
    return bounds(found.extents.repeat_interleave(count, 0), turns).view(count, count, 3)


def _window(maps: BevMaps, index: int) -> BevMaps:
    """Return one window's maps, with a batch of one."""
    own = {name: value[index : index + 1].detach() for name, value in vars(maps).items() if value is not None}
    return BevMaps(**own)


def decode(
    maps: BevMaps, x: Int64[Tensor, "cells"], y: Int64[Tensor, "cells"], grid: BevGrid
) -> tuple[Float[Tensor, "cells 3"], Float[Tensor, "cells 3"], Float[Tensor, "cells 2"], Float[Tensor, "cells"] | None]:
    """Read centres (m), half-sizes (m), velocities (m/s) and yaws (radians) off one window's maps at some cells.

    Yaws lie in (-pi/2, pi/2]: half a turn makes the same box. There are none where the maps have none.
    """
    offset, height, extent, velocity = (
        values[0, :, x, y].T.float() for values in (maps.offset, maps.height, maps.extent, maps.velocity)
    )
    cells = torch.stack([x, y], 1) + 0.5 + offset
    ground = cells * offset.new_tensor(grid.cell) + offset.new_tensor(grid.lower)
    yaws = None if maps.yaw is None else torch.atan2(*maps.yaw[0, :, x, y].float()) / 2
    return torch.cat([ground, height], 1), extent.clamp(-4.0, 4.0).exp(), velocity, yaws
