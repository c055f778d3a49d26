"""Heads: modal centres in bird's-eye view, and classes of voxels and points."""

from most.heads.centre import CentreHead, CentreMaps, OrientedCentreHead
from most.heads.semantic import SemanticHead, SemanticLogits

__all__ = ["CentreHead", "CentreMaps", "OrientedCentreHead", "SemanticHead", "SemanticLogits"]
