"""Heads: modal centres in bird's-eye view or offsets to them, and classes of voxels and points."""

from most.heads.centre import CentreHead, CentreMaps, OrientedCentreHead
from most.heads.offset import OffsetHead, VoxelOffsets
from most.heads.semantic import SemanticHead, SemanticLogits

__all__ = [
    "CentreHead",
    "CentreMaps",
    "OffsetHead",
    "OrientedCentreHead",
    "SemanticHead",
    "SemanticLogits",
    "VoxelOffsets",
]
