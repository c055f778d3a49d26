"""How large an instance is: strategies over its outlines (paper, section III, "Estimating modal extent"; Table I)."""

from collections.abc import Iterable
from dataclasses import dataclass

from jaxtyping import Int64
from torch import Tensor

from most.errors import ConfigError
from most.modal.instances import Axes, InstanceTable, Shapes


@dataclass
class ShrinkWrap:
    """SW: the half-sizes of the points seen in this frame, r_t = max |p - c| per axis."""

    floor: float = 0.05  # m; an instance of one point has no size, and extents are regressed as logarithms

    def __post_init__(self) -> None:
        check_floor(self.floor)

    def build(self, training: Iterable[InstanceTable]) -> "ShrinkWrap":
        """It is its own strategy."""
        return self

    def shapes(self, table: InstanceTable, rows: Int64[Tensor, "rows"], axes: Axes) -> Shapes:
        """Return the rows' own outlines, half-sizes of at least ``floor``."""
        half_sizes = table.outlines.half_sizes(rows, axes.planar, axes.vertical)
        return Shapes(table.centres[rows], half_sizes.clamp(min=self.floor))


@dataclass
class DropSmall(ShrinkWrap):
    """DSB: shrink-wrapped, and what has too few points is no target of the heat maps.

    It stays an instance of the truth for memberships, figures and pictures.
    """

    min_points: int = 3  # in the current sweep

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.min_points < 1:
            raise ConfigError(f"extent.min_points: expected a number of at least 1, found {self.min_points}")


@dataclass
class TrackMax:
    """MAX: the largest half-sizes of the track's frames, r = max r_t, taken in world directions."""

    floor: float = 0.05  # m

    def __post_init__(self) -> None:
        check_floor(self.floor)

    def build(self, training: Iterable[InstanceTable]) -> "TrackMax":
        """It is its own strategy."""
        return self

    def shapes(self, table: InstanceTable, rows: Int64[Tensor, "rows"], axes: Axes) -> Shapes:
        """Return the outlines of the rows' tracks, half-sizes of at least ``floor``."""
        half_sizes = table.track_outlines.half_sizes(table.tracks[rows], axes.planar, axes.vertical)
        return Shapes(table.centres[rows], half_sizes.clamp(min=self.floor))


def check_floor(floor: float) -> None:
    """Raise a ConfigError unless half-sizes have a logarithm."""
    if not floor > 0:
        raise ConfigError(f"extent.floor: expected a length above 0 m, found {floor}")
