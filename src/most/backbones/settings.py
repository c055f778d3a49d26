"""The backbones to choose from: one network, three sets of defaults."""

from dataclasses import dataclass, field

from most.backbones.blocks import AsymmetricBlock, ResidualBlock
from most.backbones.contract import Backbone
from most.backbones.unet import UNet
from most.errors import ConfigError

BLOCKS = {"asymmetric": AsymmetricBlock, "residual": ResidualBlock}


@dataclass
class UNetSettings:
    """A sparse U-Net; what differs between the backbones are these options."""

    widths: list[int] = field(default_factory=lambda: [16, 32, 64, 128])  # channels, from full resolution to 1/8
    block: str = "asymmetric"  # asymmetric (3x1x3 and 1x3x3, as Cylinder3D) or residual (3x3x3)
    down_kernel: int = 3  # 3: overlapping windows, the occupied part grows; 2: tiles, half the cost
    bev_channels: int = 128
    bev_squeeze: bool = False  # squeeze columns to bev_channels, sparsely, before the dense convolutions
    shortcut: bool = False  # from the input voxels to the bottleneck, past the halvings; not the paper's
    separate: bool = False  # a network of its own, encoder and all, for detection ("w/o sharing", Table I)

    def __post_init__(self) -> None:
        if len(self.widths) != 4 or min(self.widths) < 1:
            raise ConfigError(f"backbone.widths: expected 4 positive widths, found {self.widths}")
        if self.block not in BLOCKS:
            raise ConfigError(f"backbone.block: expected one of {', '.join(BLOCKS)}, found {self.block!r}")
        if self.down_kernel not in (2, 3):
            raise ConfigError(f"backbone.down_kernel: expected 2 or 3, found {self.down_kernel}")
        if self.bev_channels < 1:
            raise ConfigError(f"backbone.bev_channels: expected at least 1, found {self.bev_channels}")

    def build(self, in_channels: int, grid_shape: tuple[int, int, int], decoder: bool = True) -> Backbone:
        """See :class:`most.backbones.contract.BackboneSettings`."""
        height = -(-grid_shape[2] // 2 ** (len(self.widths) - 1))
        return UNet(
            in_channels,
            list(self.widths),
            BLOCKS[self.block],
            self.down_kernel,
            height,
            self.bev_channels,
            self.bev_squeeze,
            self.shortcut,
            decoder,
        )


@dataclass
class AsymmetricUNetSettings(UNetSettings):
    """The paper's backbone: asymmetric blocks, 3-wide halvings, columns of 512 channels under the BEV convolutions."""


@dataclass
class ResidualUNetSettings(UNetSettings):
    """3 x 3 x 3 residual blocks in place of the asymmetric ones."""

    block: str = "residual"


@dataclass
class AsymmetricUNetSmallSettings(UNetSettings):
    """The paper's blocks at the cost that two processor cores allow: 2-wide halvings, a narrow BEV branch."""

    down_kernel: int = 2
    bev_channels: int = 64
    bev_squeeze: bool = True
