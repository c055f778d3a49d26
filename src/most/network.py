"""The stage-1 network: point encoder, backbone, detection and semantic heads (paper, Fig. 2 a and b)."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor, nn

from most.backbones import Backbone
from most.encoder import PointMLP
from most.heads import CentreMaps, SemanticLogits
from most.sparse import Sites, SparseTensor
from most.structures import BevMaps, Sample, Voxels
from most.voxels import BevGrid, Grid, voxelise


@dataclass
class NetworkOutput:
    """What stage 1 says of a batch of windows, with the features that stage 2 builds on."""

    voxels: Voxels
    maps: BevMaps
    current: Int64[Tensor, "current"]  # which of the points in range belong to the current sweeps
    voxel_logits: Float[Tensor, "voxels classes"]  # column c is training id c + 1
    point_logits: Float[Tensor, "current classes"]
    point_features: Float[Tensor, "inputs point_channels"]  # F_point
    bev: Float[Tensor, "batch bev_channels x y"]  # F_bev


class Network(nn.Module):
    """Encodes windows of sweeps; detects modal centres and classifies voxels and points."""

    def __init__(
        self, grid: Grid, encoder: PointMLP, backbone: Backbone, centre_head: CentreMaps, semantic_head: SemanticLogits
    ) -> None:
        super().__init__()
        self.grid = grid
        self.encoder = encoder
        self.backbone = backbone
        self.centre_head = centre_head
        self.semantic_head = semantic_head

    @property
    def bev_grid(self) -> BevGrid:
        """The cells of the detection maps."""
        return self.grid.bev(self.backbone.bev_stride)

    def forward(self, samples: list[Sample]) -> NetworkOutput:
        """Run stage 1 on a batch of windows."""
        voxels = voxelise(samples, self.grid)
        points = torch.cat([sample.points for sample in samples])[voxels.inputs]
        point_features, voxel_features = self.encoder(points, voxels)
        sites = Sites(voxels.coordinates, voxels.shape, voxels.batch_size)
        features = self.backbone(SparseTensor(voxel_features, sites))
        maps = self.centre_head(features.bev)
        current = is_current(samples)[voxels.inputs].nonzero().squeeze(1)
        voxel_logits, point_logits = self.semantic_head(
            features.voxels,
            point_features[current],
            features.bev,
            voxels.point_voxel[current],
            self.voxel_cells(voxels)[voxels.point_voxel[current]],
        )
        return NetworkOutput(voxels, maps, current, voxel_logits, point_logits, point_features, features.bev)

    def voxel_cells(self, voxels: Voxels) -> Int64[Tensor, "voxels"]:
        """Return the BEV cell of each voxel, counted over (batch, x, y)."""
        batch, x, y, _ = voxels.coordinates.unbind(1)
        width, depth = self.bev_grid.shape
        stride = self.backbone.bev_stride
        return (batch * width + x // stride) * depth + y // stride


def is_current(samples: list[Sample]) -> Bool[Tensor, "points"]:
    """Return which of a batch's points, concatenated, belong to the current sweeps."""
    return torch.cat(
        [torch.arange(len(sample.points), device=sample.points.device) < sample.num_current for sample in samples]
    )
