"""Panoptic nuScenes in its official layout, read without the devkit."""

from most.datasets.nuscenes.boxes import AmodalBoxes
from most.datasets.nuscenes.reader import NuScenesSettings, PanopticNuScenes
from most.datasets.nuscenes.splits import VERSIONS, SceneSplits, official_scenes

__all__ = ["VERSIONS", "AmodalBoxes", "NuScenesSettings", "PanopticNuScenes", "SceneSplits", "official_scenes"]
