"""The shared point MLP and the mean of its output in each voxel (paper, section III, overview; Fig. 2)."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import torch
from jaxtyping import Float
from torch import Tensor, nn

from most.errors import ConfigError
from most.geometry.means import group_means
from most.normed_linear import NormedLinear
from most.normed_pair import NormedPair
from most.structures import Voxels
from most.voxels import Grid

POINT_CHANNELS = 12  # position 3, intensity, time, distance, offsets from the voxel's mean 3 and middle 3
VOXEL_CHANNELS = 7  # the raw mean: offset of the mean from the middle 3, height, intensity, time, log count
MOMENT = 0.25  # s that ages are counted in; in seconds they would be too small to be heard beside the rest


@dataclass
class PointEncoder:
    """Widths of the point MLP's layers; the last is the width of F_point."""

    widths: list[int] = field(default_factory=lambda: [64, 128, 256, 32])

    def __post_init__(self) -> None:
        if not self.widths or min(self.widths) < 1:
            raise ConfigError(f"encoder.widths: expected at least one positive width, found {self.widths}")

    def build(self, grid: Grid) -> "PointMLP":
        """Make the network for a grid."""
        return PointMLP(self.widths, grid)


class PointMLP(nn.Module):
    """Encodes every point and gathers the mean in its voxel, with the raw mean beside it."""

    def __init__(self, widths: list[int], grid: Grid) -> None:
        super().__init__()
        self.grid = grid
        self.layers = nn.Sequential(*normed_layers([POINT_CHANNELS, *widths]))
        self.point_channels = widths[-1]
        self.voxel_channels = widths[-1] + VOXEL_CHANNELS

    def forward(
        self, points: Float[Tensor, "inputs 5"], voxels: Voxels
    ) -> tuple[Float[Tensor, "inputs features"], Float[Tensor, "voxels mixed"]]:
        """Return F_point of every point in range, and the features of every voxel."""
        described, raw = describe(points, voxels, self.grid)
        features = self.layers(described)
        return features, torch.cat([group_means(features, voxels.point_voxel, len(voxels))[0], raw], 1)


def normed_layers(widths: list[int]) -> Iterator[nn.Module]:
    """Yield the layers between these widths; a layer that narrows to less than a half is paired with the one before."""
    while len(widths) > 1:
        if len(widths) > 2 and 2 * widths[2] < widths[1]:
            yield NormedPair(*widths[:3])
            widths = widths[2:]
        else:
            yield NormedLinear(*widths[:2])
            widths = widths[1:]


def describe(
    points: Float[Tensor, "inputs 5"], voxels: Voxels, grid: Grid
) -> tuple[Float[Tensor, "inputs 12"], Float[Tensor, "voxels 7"]]:
    """Return the raw features of points and of voxels, scaled to about one."""
    size, reach = points.new_tensor(grid.voxel_size), points.new_tensor(grid.upper)
    middles = grid.middles(voxels.coordinates[:, 1:])
    xyz, rest = points[:, :3], torch.cat([points[:, 3:4], points[:, 4:] / MOMENT], 1)
    index = voxels.point_voxel
    means, counts = group_means(torch.cat([xyz, rest], 1), index, len(voxels))
    described = torch.cat(
        [
            xyz / reach,
            rest,
            xyz[:, :2].norm(dim=1, keepdim=True) / reach[0],
            (xyz - means[index, :3]) / size,
            ((xyz - middles[index]) / size).clamp(-2, 2),  # points clipped into the border layers lie further off
        ],
        1,
    )
    log_counts = counts.to(points.dtype).log()[:, None]
    raw = torch.cat([((means[:, :3] - middles) / size).clamp(-2, 2), means[:, 2:], log_counts], 1)
    return described, raw
