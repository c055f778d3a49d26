"""The words every stage speaks: Sweep, Instances, Sample, Voxels, BevMaps, Detections, Panoptic, Observations, Tracks.

Frames: *sensor* is the current sweep's lidar frame as its dataset has it, in metres with z up (SemanticKITTI's x points
forward and y left, nuScenes' x right and y forward); *world* is the frame of a sequence's poses; *grid* counts voxels
or bird's-eye-view (BEV) cells from the lower corner of the range.
Class ids are training ids (0 is void) everywhere except in fields named ``labels`` and ``keys``, which hold a
dataset's own raw labels, widened to int64: they identify an instance, and metrics need them untouched.
"""

from dataclasses import dataclass, fields, replace
from typing import TypeVar

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

Structure = TypeVar("Structure", bound="OnDevice")
Table = TypeVar("Table", bound="Rows")


class OnDevice:
    """Moves every tensor of a dataclass, nested ones too; Lightning calls ``to`` on whatever has one."""

    def to(self: Structure, device: torch.device | str, non_blocking: bool = False) -> Structure:
        """Return a copy whose tensors lie on ``device``."""
        moved = {
            field.name: value.to(device, non_blocking=non_blocking)
            for field in fields(self)  # type: ignore[arg-type]
            if isinstance(value := getattr(self, field.name), Tensor | OnDevice)
        }
        return replace(self, **moved)  # type: ignore[type-var]


class Rows(OnDevice):
    """A dataclass of tensors that all have a row for each item; an optional one is None for all of them."""

    def __len__(self) -> int:
        return len(next(iter(vars(self).values())))

    def select(self: Table, keep: Tensor) -> Table:
        """Keep the rows that a boolean mask or an index names."""
        return type(self)(**{name: None if value is None else value[keep] for name, value in vars(self).items()})

    @classmethod
    def cat(cls: type[Table], parts: list[Table]) -> Table:
        """Put several tables under one another."""
        columns = {name: [getattr(part, name) for part in parts] for name in vars(parts[0])}
        return cls(**{name: None if column[0] is None else torch.cat(column) for name, column in columns.items()})


@dataclass
class Sweep(OnDevice):
    """One revolution of the lidar, as it lies on disk."""

    sequence: str
    index: int  # position in the sequence, from 0
    points: Float[Tensor, "points 4"]  # x, y, z (m, sensor) and intensity in [0, 1]
    pose: Float[Tensor, "4 4"]  # float64, world from sensor
    time: float  # seconds
    labels: Int64[Tensor, "points"] | None  # raw labels; None where a split has none


@dataclass
class Instances(Rows):
    """The thing instances visible in one sweep, in its sensor frame (paper, section III, modal recognition)."""

    keys: Int64[Tensor, "instances"]  # raw label: unique within the sweep
    classes: Int64[Tensor, "instances"]
    counts: Int64[Tensor, "instances"]  # points in this sweep
    centres: Float[Tensor, "instances 3"]  # modal centre: mean of the instance's points, m; a box's middle if amodal
    extents: Float[Tensor, "instances 3"]  # half-sizes about the centre along the axes, m, by the extent strategy
    velocities: Float[Tensor, "instances 2"]  # of the centre relative to the ground, turned into the axes here, m/s
    velocity_known: Bool[Tensor, "instances"]
    yaws: Float[Tensor, "instances"] | None = None  # from x to where ``extents`` lie along; None: along the axes


@dataclass
class Sample(OnDevice):
    """A window of sweeps in the current sensor frame, and the truth of the current sweep; a batch is a list of them."""

    sequence: str
    index: int  # of the current sweep
    points: Float[Tensor, "points 5"]  # x, y, z, intensity, time relative to the current sweep (s, <= 0)
    num_current: int  # the first ``num_current`` points are the current sweep's, in the order of its file
    labels: Int64[Tensor, "current"] | None
    semantics: Int64[Tensor, "current"] | None
    instances: Instances | None


@dataclass
class Voxels(OnDevice):
    """Occupied voxels of a batch of windows, sorted by (batch, x, y, z), and the way back to the points."""

    coordinates: Int64[Tensor, "voxels 4"]  # batch, x, y, z (grid)
    shape: tuple[int, int, int]  # voxels along x, y, z
    batch_size: int
    point_voxel: Int64[Tensor, "inputs"]  # the voxel of each point in range (an *input*)
    inputs: Int64[Tensor, "inputs"]  # which of the batch's points, concatenated, are in range

    def __len__(self) -> int:
        return len(self.coordinates)


@dataclass
class BevMaps(OnDevice):
    """The detection heads' maps, indexed [batch, channel, x, y]; also the form of their targets."""

    heatmap: Float[Tensor, "batch things x y"]  # logits (targets: in [0, 1])
    offset: Float[Tensor, "batch 2 x y"]  # of the centre from its cell's middle, cells
    height: Float[Tensor, "batch 1 x y"]  # z of the modal centre, m
    extent: Float[Tensor, "batch 3 x y"]  # log of the half-sizes in m
    velocity: Float[Tensor, "batch 2 x y"]  # m/s
    yaw: Float[Tensor, "batch 2 x y"] | None = None  # sine and cosine of twice the yaw: boxes have no front


@dataclass
class Detections(Rows):
    """Modal centres detected in one sweep, most confident first, in its sensor frame."""

    classes: Int64[Tensor, "detections"]
    scores: Float[Tensor, "detections"]  # in [0, 1]
    centres: Float[Tensor, "detections 3"]  # m
    extents: Float[Tensor, "detections 3"]  # half-sizes, m
    velocities: Float[Tensor, "detections 2"]  # m/s; NaN where unknown
    yaws: Float[Tensor, "detections"] | None = None  # from x to where ``extents`` lie along; None: along the axes

    @staticmethod
    def none(like: Tensor) -> "Detections":
        """Detections of a sweep in which there are none, where ``like`` lies and of its kind."""
        row = like.new_zeros(0, 3)
        return Detections(row[:, 0].long(), row[:, 0], row, row, row[:, :2])


@dataclass
class Panoptic(OnDevice):
    """A class and an instance id for every point of one sweep."""

    semantics: Int64[Tensor, "points"]
    ids: Int64[Tensor, "points"]  # from 1 for points of things, 0 for stuff; detection i of the sweep owns id i + 1


@dataclass
class Observations(Rows):
    """The segments of things in one sweep, in its sensor frame: what a tracker is told."""

    classes: Int64[Tensor, "segments"]
    centres: Float[Tensor, "segments 3"]  # modal centre, m
    extents: Float[Tensor, "segments 3"]  # half-sizes about the centre along the axes, m
    velocities: Float[Tensor, "segments 2"]  # relative to the ground, along the axes here, m/s
    velocity_known: Bool[Tensor, "segments"]
    scores: Float[Tensor, "segments"]  # in [0, 1]
    placed: Bool[Tensor, "segments"]  # False where no point is somewhere: centre and extents say nothing then


@dataclass
class Tracks(Rows):
    """The objects that a tracker follows, the oldest first, in the sensor frame of the last sweep."""

    ids: Int64[Tensor, "tracks"]
    classes: Int64[Tensor, "tracks"]
    centres: Float[Tensor, "tracks 3"]  # where each is, or, out of sight, is expected, m
    extents: Float[Tensor, "tracks 3"]  # half-sizes as last seen, m
    velocities: Float[Tensor, "tracks 2"]  # relative to the ground, along the axes here, m/s
    hits: Int64[Tensor, "tracks"]  # sweeps that saw it
    first_seen: Float[Tensor, "tracks"]  # float64, s, on the clock of the sweeps
    last_seen: Float[Tensor, "tracks"]  # float64, s
