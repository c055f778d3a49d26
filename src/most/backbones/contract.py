"""What every backbone takes and gives, and what its settings have to offer."""

from dataclasses import dataclass
from typing import Protocol

from jaxtyping import Float
from torch import Tensor, nn

from most.sparse import SparseTensor


@dataclass
class BackboneFeatures:
    """The two outputs of a backbone (paper, figure 2)."""

    voxels: Float[Tensor, "voxels channels"]  # one row a voxel of the input, in its order
    bev: Float[Tensor, "batch bev_channels x y"]  # F^bev: cells of ``bev_stride`` voxels, from the grid's lower corner


class Backbone(nn.Module):
    """A network from the features of occupied voxels to features of the same voxels and of a bird's-eye view."""

    voxel_channels: int  # 0 where it has no decoder
    bev_channels: int
    bev_stride: int  # voxels along the side of a BEV cell; the map has ceil(size / stride) cells along an axis

    def forward(self, x: SparseTensor) -> BackboneFeatures:
        """Encode a batch of voxel grids."""
        raise NotImplementedError


class BackboneSettings(Protocol):
    """The dataclass that is a backbone's configuration schema; it is listed in ``most.config.COMPONENTS``."""

    separate: bool  # another network of the same kind for detection ("w/o sharing", Table I); False by default

    def build(self, in_channels: int, grid_shape: tuple[int, int, int], decoder: bool = True) -> Backbone:
        """Make the network for features of ``in_channels`` on a grid of ``grid_shape`` (x, y, z) voxels.

        Without a ``decoder`` it gives the bird's-eye view alone.
        """
        ...
