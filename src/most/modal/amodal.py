"""Annotated boxes instead of what the points show (paper, Table I, "Amodal Det.")."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from most.modal.boxes import BoxedTable
from most.modal.extent import ShrinkWrap, check_floor
from most.modal.instances import Axes, InstanceTable, Shapes


@dataclass
class Amodal:
    """A box's middle, half-sizes and yaw; an instance without a box is shrink-wrapped, along the window's axes."""

    floor: float = 0.05  # m

    def __post_init__(self) -> None:
        check_floor(self.floor)

    def build(self, training: Iterable[InstanceTable]) -> "Amodal":
        """It is its own strategy."""
        return self

    def shapes(self, table: InstanceTable, rows: Int64[Tensor, "rows"], axes: Axes) -> Shapes:
        """Return the rows' boxes; they follow any turn, flip or scale exactly, as a shear would not leave them boxes.

        The table is a ``BoxedTable``.
        """
        assert isinstance(table, BoxedTable)  # most.datasets.instances makes no others for this strategy
        boxes, seen = table.boxes, ShrinkWrap(self.floor).shapes(table, rows, axes)
        known, yaws = boxes.known[rows], boxes.yaws[rows]
        ahead, aside = (_directions(yaws + turn) @ axes.planar.T for turn in (0.0, math.pi / 2))
        up = torch.full_like(yaws, abs(axes.vertical))
        scales = torch.stack([ahead.norm(dim=1), aside.norm(dim=1), up], 1)
        half_sizes = (boxes.half_sizes[rows] * scales).clamp(min=self.floor)
        return Shapes(
            centres=boxes.centres[rows].where(known[:, None], seen.centres),
            half_sizes=half_sizes.where(known[:, None], seen.half_sizes),
            yaws=torch.atan2(ahead[:, 1], ahead[:, 0]).where(known, 0.0),
        )


def _directions(yaws: Float64[Tensor, "boxes"]) -> Float64[Tensor, "boxes 2"]:
    return torch.stack([yaws.cos(), yaws.sin()], 1)
