"""Voxel classification and its refinement at the points (paper, section III, semantic segmentation; Eq. 1)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn


@dataclass
class SemanticHead:
    """Whether a linear layer over [voxel logits, F_point, F_bev] refines the points, or they read their voxel's."""

    refine_points: bool = True

    def build(self, classes: int, voxel_channels: int, point_channels: int, bev_channels: int) -> "SemanticLogits":
        """Make the network."""
        return SemanticLogits(classes, voxel_channels, (point_channels, bev_channels) if self.refine_points else None)


class SemanticLogits(nn.Module):
    """Logits of every voxel and of every point, over the classes without void: column c is training id c + 1."""

    def __init__(self, classes: int, voxel_channels: int, refinement: tuple[int, int] | None) -> None:
        super().__init__()
        self.voxel = nn.Linear(voxel_channels, classes)
        self.point = None
        if refinement is not None:
            self.point = nn.Linear(classes + sum(refinement), classes)
            with torch.no_grad():  # it starts as the voxel's own answer
                self.point.weight.mul_(0.1)
                self.point.weight[:, :classes] = torch.eye(classes)
                self.point.bias.zero_()

    def forward(
        self,
        voxel_features: Float[Tensor, "voxels voxel_channels"],
        point_features: Float[Tensor, "points point_channels"],
        bev: Float[Tensor, "batch bev_channels x y"],
        point_voxel: Int64[Tensor, "points"],
        point_cell: Int64[Tensor, "points"],
    ) -> tuple[Float[Tensor, "voxels classes"], Float[Tensor, "points classes"]]:
        """Return the logits of voxels and points; ``point_cell`` counts BEV cells over (batch, x, y)."""
        voxel_logits = self.voxel(voxel_features)
        if self.point is None:
            return voxel_logits, voxel_logits.index_select(0, point_voxel)
        # A linear layer over a concatenation is a sum of linear layers: each is applied where its input lives, and
        # the few logits are gathered instead of the many features. `index_select` adds its gradients up in one order;
        # indexing would, on several threads, in another one every time.
        widths = [voxel_logits.shape[1], point_features.shape[1], bev.shape[1]]
        by_voxel, by_point, by_bev = self.point.weight.split(widths, dim=1)
        of_voxels = nn.functional.linear(voxel_logits, by_voxel, self.point.bias)
        of_cells = nn.functional.linear(bev.permute(0, 2, 3, 1).flatten(0, 2), by_bev)
        refined = nn.functional.linear(point_features, by_point)
        refined = refined + of_voxels.index_select(0, point_voxel) + of_cells.index_select(0, point_cell)
        return voxel_logits, refined
