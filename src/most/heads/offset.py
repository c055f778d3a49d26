"""DS-Net's head: where the modal centre of the instance lies that a voxel belongs to (Table I, offset regression)."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor, nn

from most.errors import ConfigError
from most.normed_linear import NormedLinear


@dataclass
class OffsetHead:
    """Two hidden layers over the decoder's voxels, as DS-Net has them; nothing is detected in bird's-eye view."""

    channels: int = 32

    gives = "offsets"

    def __post_init__(self) -> None:
        if self.channels < 1:
            raise ConfigError(f"heads.centre.channels: expected a positive number, found {self.channels}")

    def build(self, channels: int, num_things: int) -> "VoxelOffsets":
        """Make the network over voxels of ``channels``; offsets do not depend on the class."""
        return VoxelOffsets(channels, self.channels)


class VoxelOffsets(nn.Module):
    """Regresses an offset from each voxel's middle."""

    def __init__(self, voxel_channels: int, channels: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(NormedLinear(voxel_channels, channels), NormedLinear(channels, channels))
        self.out = nn.Linear(channels, 3)
        nn.init.normal_(self.out.weight, std=1e-3)
        nn.init.zeros_(self.out.bias)

    def forward(self, voxels: Float[Tensor, "voxels voxel_channels"]) -> Float[Tensor, "voxels 3"]:
        """Return the offsets, m."""
        offsets: Tensor = self.out(self.layers(voxels))
        return offsets
