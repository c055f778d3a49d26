"""The modal detection head: class-wise centre heat maps, offset, height, extent and velocity (paper, Eq. 2 and 4)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from most.errors import ConfigError
from most.norm import NormReLU
from most.structures import BevMaps

REGRESSED = {"offset": 2, "height": 1, "extent": 3, "velocity": 2}


@dataclass
class CentreHead:
    """One head with K thing channels; two 3 x 3 convolutions (paper, implementation details)."""

    channels: int = 64
    heatmap_bias: float = -2.19  # sigmoid(-2.19) = 0.1: few cells hold a centre

    gives = "centres"

    def __post_init__(self) -> None:
        if self.channels < 1:
            raise ConfigError(f"heads.centre.channels: expected a positive number, found {self.channels}")

    def build(self, bev_channels: int, num_things: int) -> "CentreMaps":
        """Make the network."""
        return CentreMaps(bev_channels, self.channels, num_things, self.heatmap_bias, REGRESSED)


@dataclass
class OrientedCentreHead(CentreHead):
    """The same with a yaw, for amodal boxes (paper, Table I, "Amodal Det.")."""

    def build(self, bev_channels: int, num_things: int) -> "CentreMaps":
        """Make the network."""
        return CentreMaps(bev_channels, self.channels, num_things, self.heatmap_bias, REGRESSED | {"yaw": 2})


class CentreMaps(nn.Module):
    """Reads the detection maps off the bird's-eye-view features."""

    def __init__(
        self, bev_channels: int, channels: int, num_things: int, heatmap_bias: float, regressed: dict[str, int]
    ) -> None:
        """``regressed`` counts the channels of each map but the first, in the order of :class:`BevMaps`."""
        super().__init__()
        self.widths = list(regressed.values())
        self.shared = nn.Sequential(nn.Conv2d(bev_channels, channels, 3, padding=1, bias=False), NormReLU(channels))
        self.heatmap = nn.Conv2d(channels, num_things, 3, padding=1)
        self.regression = nn.Conv2d(channels, sum(self.widths), 3, padding=1)
        nn.init.constant_(self.heatmap.bias, heatmap_bias)  # type: ignore[arg-type]
        nn.init.normal_(self.regression.weight, std=1e-3)
        nn.init.zeros_(self.regression.bias)  # type: ignore[arg-type]

    def forward(self, bev: Float[Tensor, "batch channels x y"]) -> BevMaps:
        """Return the maps: heat map logits, cells, m, log m, m/s; sine and cosine of twice the yaw."""
        shared = self.shared(bev)
        regression = self.regression(shared)
        return BevMaps(self.heatmap(shared), *torch.split(regression, self.widths, dim=1))
