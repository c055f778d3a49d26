"""Backbones under one contract (`contract.Backbone`): voxel features in, voxel and bird's-eye-view features out."""

from most.backbones.contract import Backbone, BackboneFeatures
from most.backbones.settings import (
    AsymmetricUNetSettings,
    AsymmetricUNetSmallSettings,
    ResidualUNetSettings,
    UNetSettings,
)

__all__ = [
    "AsymmetricUNetSettings",
    "AsymmetricUNetSmallSettings",
    "Backbone",
    "BackboneFeatures",
    "ResidualUNetSettings",
    "UNetSettings",
]
