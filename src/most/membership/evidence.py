"""What stage 1 says of one sweep, as far as a membership may look at it."""

from dataclasses import dataclass, field

import torch.nn.functional as F
from jaxtyping import Float, Int64
from torch import Tensor

from most.structures import Detections, OnDevice
from most.voxels import BevGrid


@dataclass(frozen=True)
class Channels:
    """How wide stage 1's features are."""

    classes: int  # void not counted
    things: list[int]  # class ids
    point: int  # F_point
    bev: int  # F_bev
    boxes: list[list[float]] = field(default_factory=list)  # usual length and width of each of the things, m


@dataclass
class Evidence(OnDevice):
    """The points of the current sweep with what the network made of them, and the centres it detected."""

    points: Float[Tensor, "points 3"]  # m, sensor
    semantics: Int64[Tensor, "points"]  # predicted classes
    probabilities: Float[Tensor, "points classes"]  # column c is training id c + 1; out of range all of one class
    point_features: Float[Tensor, "points point_channels"]  # F_point; zeros out of range
    bev: Float[Tensor, "bev_channels x y"]  # F_bev
    bev_grid: BevGrid
    detections: Detections
    offsets: Float[Tensor, "points 3"] | None = None  # to the instance's modal centre, m; None where none are regressed

    def bev_at(self, places: Float[Tensor, "places 3"]) -> Float[Tensor, "places bev_channels"]:
        """F_bev interpolated between the middles of the four cells about each place; beyond the map its border's."""
        grid = self.bev_grid
        lower, cell, cells = (places.new_tensor(value) for value in (grid.lower, grid.cell, grid.shape))
        middle = (places[:, :2] - lower) / (cell * cells) * 2 - 1  # in [-1, 1] over the map, as grid_sample counts
        steps = middle.nan_to_num(0.0).float()[None, :, None, [1, 0]]  # half a precision would be half a cell
        bev = self.bev[None].float()
        return F.grid_sample(bev, steps, padding_mode="border", align_corners=False)[0, :, :, 0].T
