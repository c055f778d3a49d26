"""Points to voxels and back: the grid, the voxels a batch of windows occupies, and the voxel each point falls into.

Every point of a scan gets a label, so no point is lost here: points above or below the grid are clipped into its
border layer; points beyond its sides, ``BEYOND`` above or below it, or not finite, take no part in the network and read
the label of the nearest voxel in the end (``nearest_voxel``).
"""

import math
from dataclasses import dataclass, field

import torch
from jaxtyping import Bool, Float, Int64
from scipy.spatial import cKDTree
from torch import Tensor

from most.errors import ConfigError
from most.structures import Sample, Voxels

MOST_VOXELS = 2**15  # along an axis
BEYOND = 50.0  # m above or below the grid; a stray point up there would outweigh all others in its voxel's means


@dataclass(frozen=True)
class BevGrid:
    """The cells of the detection maps, seen from above, in the sensor frame."""

    lower: tuple[float, float]  # m
    cell: tuple[float, float]  # m
    shape: tuple[int, int]


@dataclass
class Grid:
    """The voxel grid in the sensor frame (supplement, section II: 0.075 x 0.075 x 0.2 m, 54 m to each side)."""

    voxel_size: list[float] = field(default_factory=lambda: [0.075, 0.075, 0.2])  # m
    lower: list[float] = field(default_factory=lambda: [-54.0, -54.0, -4.0])  # m
    upper: list[float] = field(default_factory=lambda: [54.0, 54.0, 2.4])  # m

    def __post_init__(self) -> None:
        for name in ("voxel_size", "lower", "upper"):
            if len(getattr(self, name)) != 3:
                raise ConfigError(f"grid.{name}: expected three numbers (x, y, z), found {getattr(self, name)}")
        if not all(0 < size < math.inf for size in self.voxel_size):
            raise ConfigError(f"grid.voxel_size: expected positive metres, found {self.voxel_size}")
        if not all(map(math.isfinite, [*self.lower, *self.upper])):
            raise ConfigError(f"grid.lower, grid.upper: expected metres, found {self.lower} and {self.upper}")
        if any(high <= low for low, high in zip(self.lower, self.upper, strict=True)):
            raise ConfigError(f"grid.upper: expected more than grid.lower {self.lower}, found {self.upper}")
        if not all(1 <= voxels <= MOST_VOXELS for voxels in self.shape):
            raise ConfigError(
                f"grid.voxel_size: expected 1 to {MOST_VOXELS} voxels along each axis, found {self.shape} of "
                f"{self.voxel_size} m"
            )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Voxels along x, y and z."""
        x, y, z = (
            round((high - low) / size) for low, high, size in zip(self.lower, self.upper, self.voxel_size, strict=True)
        )
        return x, y, z

    def bev(self, stride: int) -> BevGrid:
        """Return the bird's-eye-view grid whose cells are ``stride`` voxels wide."""
        (x, y, _), (width, depth, _) = self.lower, self.shape
        cell = (self.voxel_size[0] * stride, self.voxel_size[1] * stride)
        return BevGrid((x, y), cell, (-(-width // stride), -(-depth // stride)))

    def in_range(self, points: Float[Tensor, "points channels"]) -> Bool[Tensor, "points"]:
        """Whether each point is finite in all channels, within the grid's sides, and not ``BEYOND`` it in height."""
        lower, upper = points.new_tensor(self.lower), points.new_tensor(self.upper)
        inside = (points[:, :2] >= lower[:2]) & (points[:, :2] < upper[:2])
        near = (points[:, 2] >= lower[2] - BEYOND) & (points[:, 2] <= upper[2] + BEYOND)
        return inside.all(1) & near & points.isfinite().all(1)

    def cells(self, points: Float[Tensor, "points channels"]) -> Int64[Tensor, "points 3"]:
        """The voxel of each point in range; heights are clipped into the border layers."""
        lower, size = points.new_tensor(self.lower), points.new_tensor(self.voxel_size)
        last = torch.tensor(self.shape, device=points.device) - 1
        return ((points[:, :3] - lower) / size).floor().long().clamp(min=torch.zeros_like(last), max=last)

    def middles(self, cells: Int64[Tensor, "voxels 3"]) -> Float[Tensor, "voxels 3"]:
        """The middle of each voxel, m, sensor frame."""
        size = torch.tensor(self.voxel_size, device=cells.device)
        return (cells + 0.5) * size + torch.tensor(self.lower, device=cells.device)


def voxelise(samples: list[Sample], grid: Grid) -> Voxels:
    """Return the voxels that a batch's windows occupy."""
    points = torch.cat([sample.points for sample in samples])
    batch = torch.repeat_interleave(
        torch.arange(len(samples), device=points.device),
        torch.tensor([len(sample.points) for sample in samples], device=points.device),
    )
    inputs = grid.in_range(points).nonzero().squeeze(1)
    x, y, z = grid.cells(points[inputs]).unbind(1)
    width, depth, height = grid.shape
    keys, point_voxel = torch.unique(
        ((batch[inputs] * width + x) * depth + y) * height + z, return_inverse=True, sorted=True
    )
    coordinates = torch.stack(
        [keys // (width * depth * height), keys // (depth * height) % width, keys // height % depth, keys % height], 1
    )
    return Voxels(coordinates, grid.shape, len(samples), point_voxel, inputs)


def nearest_voxel(
    points: Float[Tensor, "points channels"], cells: Int64[Tensor, "voxels 3"], grid: Grid
) -> Int64[Tensor, "points"]:
    """Return the occupied voxel nearest to each point once that is moved onto the grid (non-finite: to its middle)."""
    lower, upper = points.new_tensor(grid.lower), points.new_tensor(grid.upper)
    moved = points[:, :3].where(points[:, :3].isfinite(), (lower + upper) / 2).clamp(min=lower, max=upper)
    found = cKDTree(grid.middles(cells).cpu().numpy()).query(moved.cpu().numpy())[1]
    return torch.as_tensor(found, device=points.device)
