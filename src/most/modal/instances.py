"""The thing instances of a sequence: one row per instance and frame, and what a window's sample takes from them."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Bool, Float64, Int64
from torch import Tensor

from most.errors import DataError
from most.geometry.poses import yaw
from most.modal.outline import Outlines
from most.structures import Instances


@dataclass(frozen=True)
class Axes:
    """Along what a window looks at the instances of one sweep; its linear map leaves z upright."""

    linear: Float64[Tensor, "3 3"]  # window from sensor frame
    heading: Float64[Tensor, ""]  # yaw of the sensor's pose

    @property
    def planar(self) -> Float64[Tensor, "2 2"]:
        """The window's ground plane from world heading's."""
        return self.linear[:2, :2] @ turn(-self.heading)

    @property
    def vertical(self) -> float:
        """How z is scaled."""
        return float(self.linear[2, 2])


@dataclass
class Shapes:
    """Where instances are, how large, and how turned, one a row."""

    centres: Float64[Tensor, "rows 3"]  # sensor frame, m
    half_sizes: Float64[Tensor, "rows 3"]  # m, positive, in the window: along its axes, or along, across and up
    yaws: Float64[Tensor, "rows"] | None = None  # from the window's x to along, radians; None: along its axes


@runtime_checkable
class ExtentStrategy(Protocol):
    """Says how large an instance is."""

    def shapes(self, table: "InstanceTable", rows: Int64[Tensor, "rows"], axes: Axes) -> Shapes:
        """Return the shapes of one sweep's rows; centres are the modal ones unless a strategy knows better."""
        ...


@runtime_checkable
class Extent(Protocol):
    """What becomes a strategy, once it has asked the training split's instances what it wants to know of them."""

    def build(self, training: Iterable["InstanceTable"]) -> ExtentStrategy:
        """Make the strategy; ``training`` is only gone through where needed."""
        ...


@dataclass
class InstanceTable:
    """All instances of one sequence (paper, section III, modal recognition), the rows ordered by frame.

    An instance is a whole raw label: SemanticKITTI uses the same id for different moving and static objects. A track
    is an instance through the sequence. *World heading* is the sensor frame turned by the yaw of its pose alone, so
    that an outline turned back is exactly that of the points on disk, whatever the sensor's pitch and roll.
    """

    frames: Int64[Tensor, "frames"]  # index in the sequence, ascending
    poses: Float64[Tensor, "frames 4 4"]  # world from sensor
    starts: Int64[Tensor, "frames_and_one"]  # frame i owns rows starts[i]:starts[i + 1]
    keys: Int64[Tensor, "rows"]  # raw label
    classes: Int64[Tensor, "rows"]  # training id
    counts: Int64[Tensor, "rows"]  # points
    tracks: Int64[Tensor, "rows"]  # row of ``track_outlines``
    centres: Float64[Tensor, "rows 3"]  # modal centre, sensor frame, m
    world_centres: Float64[Tensor, "rows 3"]  # the same in the world, m
    world_velocities: Float64[Tensor, "rows 3"]  # of the modal centre relative to the ground, m/s
    velocity_known: Bool[Tensor, "rows"]
    outlines: Outlines  # one a row
    track_outlines: Outlines  # one a track: all of its outlines, laid over one another at their centres

    def __len__(self) -> int:
        return len(self.keys)

    def rows(self, frame: int) -> Int64[Tensor, "rows"]:
        """Return the rows of the table's ``frame``-th frame."""
        return torch.arange(int(self.starts[frame]), int(self.starts[frame + 1]))

    def instances(
        self,
        index: int,
        strategy: ExtentStrategy,
        linear: Float64[Tensor, "3 3"],
        translation: Float64[Tensor, "3"],
    ) -> Instances:
        """Return the instances of the sweep ``index`` after x -> ``linear`` x + ``translation`` of its sensor frame.

        ``linear`` may turn, flip, scale or shear the ground plane and scale z; everything follows it exactly.
        Velocities stay relative to the ground: the sensor's own motion is no part of them. Raises DataError for an
        unknown index.
        """
        frame = int(torch.searchsorted(self.frames, index))
        if frame == len(self.frames) or self.frames[frame] != index:
            raise DataError(f"instance table: expected a labelled sweep {index}, found none among {len(self.frames)}")
        rows, rotation = self.rows(frame), self.poses[frame, :3, :3]
        shapes = strategy.shapes(self, rows, Axes(linear, yaw(self.poses[frame])))
        velocities = self.world_velocities[rows] @ rotation @ linear.T
        return Instances(
            keys=self.keys[rows],
            classes=self.classes[rows],
            counts=self.counts[rows],
            centres=(shapes.centres @ linear.T + translation).float(),
            extents=shapes.half_sizes.float(),
            velocities=velocities[:, :2].float(),
            velocity_known=self.velocity_known[rows],
            yaws=None if shapes.yaws is None else shapes.yaws.float(),
        )


def turn(angle: Float64[Tensor, ""]) -> Float64[Tensor, "2 2"]:
    """Return the counter-clockwise rotation of the plane by ``angle`` radians."""
    cos, sin = torch.cos(angle), torch.sin(angle)
    return torch.stack([torch.stack([cos, -sin]), torch.stack([sin, cos])])
