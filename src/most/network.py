"""The stage-1 network: point encoder, backbone, detection and semantic heads (paper, Fig. 2 a and b)."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor, nn

from most.backbones import Backbone, BackboneFeatures
from most.encoder import PointMLP
from most.heads import CentreMaps, SemanticLogits, VoxelOffsets
from most.sparse import Sites, SparseTensor
from most.structures import BevMaps, Sample, Voxels
from most.voxels import BevGrid, Grid, voxelise


@dataclass
class NetworkOutput:
    """What stage 1 says of a batch of windows, with the features that stage 2 builds on."""

    voxels: Voxels
    maps: BevMaps | None  # None where offsets are regressed in their stead
    current: Int64[Tensor, "current"]  # which of the points in range belong to the current sweeps
    voxel_logits: Float[Tensor, "voxels classes"]  # column c is training id c + 1
    point_logits: Float[Tensor, "current classes"]
    point_features: Float[Tensor, "inputs point_channels"]  # F_point
    bev: Float[Tensor, "batch bev_channels x y"]  # F_bev: what instances are found in
    offsets: Float[Tensor, "current 3"] | None = None  # from each point to its instance's modal centre, m


class Trunk(nn.Module):
    """What heads stand on: point encoder and backbone."""

    def __init__(self, encoder: PointMLP, backbone: Backbone) -> None:
        super().__init__()
        self.encoder = encoder
        self.backbone = backbone

    def encode(
        self, points: Float[Tensor, "inputs 5"], voxels: Voxels
    ) -> tuple[Float[Tensor, "inputs point_channels"], BackboneFeatures]:
        """Return F_point of every point in range, and the features of voxels and of the bird's-eye view."""
        point_features, voxel_features = self.encoder(points, voxels)
        sites = Sites(voxels.coordinates, voxels.shape, voxels.batch_size)
        return point_features, self.backbone(SparseTensor(voxel_features, sites))


class Network(Trunk):
    """Encodes windows of sweeps; finds instances and classifies voxels and points.

    Its own trunk serves all heads, but for instances where there is one for ``detection``.
    """

    def __init__(
        self,
        grid: Grid,
        encoder: PointMLP,
        backbone: Backbone,
        centre_head: CentreMaps | VoxelOffsets,
        semantic_head: SemanticLogits,
        detection: Trunk | None = None,
    ) -> None:
        super().__init__(encoder, backbone)
        self.grid = grid
        self.centre_head = centre_head
        self.semantic_head = semantic_head
        self.detection = detection

    @property
    def bev_grid(self) -> BevGrid:
        """The cells of the detection maps."""
        return self.grid.bev(self.backbone.bev_stride)

    def forward(self, samples: list[Sample]) -> NetworkOutput:
        """Run stage 1 on a batch of windows."""
        voxels = voxelise(samples, self.grid)
        points = torch.cat([sample.points for sample in samples])[voxels.inputs]
        point_features, features = self.encode(points, voxels)
        seen = features if self.detection is None else self.detection.encode(points, voxels)[1]
        current = is_current(samples)[voxels.inputs].nonzero().squeeze(1)
        maps, offsets = self._instances(seen, voxels, points, current)
        voxel_logits, point_logits = self.semantic_head(
            features.voxels,
            point_features[current],
            features.bev,
            voxels.point_voxel[current],
            self.voxel_cells(voxels)[voxels.point_voxel[current]],
        )
        return NetworkOutput(voxels, maps, current, voxel_logits, point_logits, point_features, seen.bev, offsets)

    def _instances(
        self,
        seen: BackboneFeatures,
        voxels: Voxels,
        points: Float[Tensor, "inputs 5"],
        current: Int64[Tensor, "current"],
    ) -> tuple[BevMaps | None, Float[Tensor, "current 3"] | None]:
        """Return detection maps, or the offset of each current point to where its voxel says that the centre is."""
        if isinstance(self.centre_head, CentreMaps):
            return self.centre_head(seen.bev), None
        votes = self.grid.middles(voxels.coordinates[:, 1:]) + self.centre_head(seen.voxels).float()
        return None, votes.index_select(0, voxels.point_voxel[current]) - points[current, :3]

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
