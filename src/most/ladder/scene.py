"""One sweep on its way through inference, and the truth about it."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Int64
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.membership import Evidence, Membership
from most.modal.voxel_labels import majority
from most.structures import BevMaps, Instances, Sample
from most.voxels import Grid, nearest_voxel, voxelise


@dataclass
class Truth:
    """What is known of one sweep."""

    labels: Int64[Tensor, "points"]  # raw
    semantics: Int64[Tensor, "points"]  # 0: unknown
    voxel_semantics: Int64[Tensor, "points"]  # what most of the points in the same voxel are; 0: unknown
    instances: Instances

    @staticmethod
    def of(
        sample: Sample, labels: Int64[Tensor, "points"], instances: Instances, grid: Grid, taxonomy: Taxonomy
    ) -> "Truth":
        """Gather what labels and instances say of the current sweep."""
        semantics = taxonomy.to_training(labels, f"{sample.sequence}, scan {sample.index}")
        by_voxel = voxel_majority(sample, semantics, grid, taxonomy.num_classes)
        return Truth(labels, semantics, by_voxel, instances)


@dataclass
class Scene:
    """One sweep as far as detections, and how its points will be given to them."""

    evidence: Evidence
    maps: BevMaps | None  # batch of one; None where no model looked
    owners: Int64[Tensor, "detections"]  # the instance of the truth that each detection stands for, -1 for none
    membership: Membership


def voxel_majority(
    sample: Sample, semantics: Int64[Tensor, "points"], grid: Grid, num_classes: int
) -> Int64[Tensor, "points"]:
    """Return the class of most known points in each point's voxel: the best that a network over voxels can say.

    Points beyond the grid's sides read the nearest voxel, as in inference.
    """
    current = replace(sample, points=sample.points[: sample.num_current])
    voxels = voxelise([current], grid)
    classes = majority(voxels.point_voxel, semantics[voxels.inputs], len(voxels), num_classes)
    found = torch.zeros_like(semantics).index_copy_(0, voxels.inputs, classes[voxels.point_voxel])
    outside = torch.ones_like(semantics, dtype=torch.bool).index_fill_(0, voxels.inputs, value=False)
    known = classes != 0
    if outside.any() and known.any():
        nearest = nearest_voxel(current.points[outside], voxels.coordinates[known, 1:], grid)
        found[outside] = classes[known][nearest]
    return found
