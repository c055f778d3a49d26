"""How large an instance is: strategies over its outlines (paper, section III, "Estimating modal extent")."""

from dataclasses import dataclass

from jaxtyping import Float64, Int64
from torch import Tensor

from most.errors import ConfigError
from most.modal.instances import InstanceTable


@dataclass
class ShrinkWrap:
    """SW: the half-sizes of the points seen in this frame, r_t = max |p - c| per axis."""

    floor: float = 0.05  # m; an instance of one point has no size, and extents are regressed as logarithms

    def __post_init__(self) -> None:
        _check_floor(self.floor)

    def half_sizes(
        self, table: InstanceTable, rows: Int64[Tensor, "rows"], planar: Float64[Tensor, "2 2"], vertical: float
    ) -> Float64[Tensor, "rows 3"]:
        """Return the half-sizes of the rows' own outlines, at least ``floor``, m."""
        return table.outlines.half_sizes(rows, planar, vertical).clamp(min=self.floor)


@dataclass
class TrackMax:
    """MAX: the largest half-sizes of the track's frames, r = max r_t, taken in world directions."""

    floor: float = 0.05  # m

    def __post_init__(self) -> None:
        _check_floor(self.floor)

    def half_sizes(
        self, table: InstanceTable, rows: Int64[Tensor, "rows"], planar: Float64[Tensor, "2 2"], vertical: float
    ) -> Float64[Tensor, "rows 3"]:
        """Return the half-sizes of the rows' tracks, at least ``floor``, m."""
        return table.track_outlines.half_sizes(table.tracks[rows], planar, vertical).clamp(min=self.floor)


def _check_floor(floor: float) -> None:
    if not floor > 0:
        raise ConfigError(f"extent.floor: expected a length above 0 m, found {floor}")
