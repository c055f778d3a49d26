"""What is seen of a sweep before anything is substituted: a model's evidence, or nothing."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch

from most.detections import window
from most.inference import Inference, Predictor
from most.ladder.scene import Scene
from most.membership import Evidence, Nearest, match_detections
from most.structures import Detections, Sample
from most.voxels import BevGrid, Grid

BEV_STRIDE = 8  # voxels along the side of a BEV cell, of backbones with four levels


@runtime_checkable
class Look(Protocol):
    """Looks at sweeps that have a truth."""

    has_model: bool

    @property
    def grid(self) -> Grid:
        """The voxels that classes are voted in."""
        ...

    @property
    def settings(self) -> Inference:
        """How detections and points become labels."""
        ...

    def __call__(self, samples: list[Sample]) -> list[Scene]:
        """Return what is seen of each current sweep."""
        ...


@dataclass
class ModelLook:
    """The model as it is; the network runs once a sweep, however many rungs there are."""

    predictor: Predictor

    has_model = True

    @property
    def grid(self) -> Grid:
        """The model's."""
        return self.predictor.network.grid

    @property
    def settings(self) -> Inference:
        """The model's."""
        return self.predictor.settings

    def __call__(self, samples: list[Sample]) -> list[Scene]:
        """Run stage 1 on a batch of windows."""
        output = self.predictor.network(samples)
        scenes = []
        for index, (sample, seen) in enumerate(zip(samples, self.predictor.read(output, samples), strict=True)):
            assert sample.instances is not None
            roi = self.settings.roi.half_sizes(seen.detections.extents)
            owners = match_detections(seen.detections, roi, sample.instances)
            scenes.append(Scene(seen, window(output.maps, index), owners, self.predictor.membership))
        return scenes


@dataclass
class NoModel:
    """Nothing is seen: all is void, nothing is detected, and points would go to the nearest centre."""

    grid: Grid
    settings: Inference
    num_classes: int  # with void

    has_model = False

    def __call__(self, samples: list[Sample]) -> list[Scene]:
        """Return evidence of nothing."""
        return [Scene(self._nothing(sample), None, torch.zeros(0, dtype=torch.long), Nearest()) for sample in samples]

    def _nothing(self, sample: Sample) -> Evidence:
        points = sample.points[: sample.num_current, :3]
        grid: BevGrid = self.grid.bev(BEV_STRIDE)
        whole, rows = torch.zeros(0, dtype=torch.long), points.new_zeros(0, 3)
        return Evidence(
            points=points,
            semantics=torch.zeros(len(points), dtype=torch.long),
            probabilities=points.new_zeros(len(points), self.num_classes - 1),
            point_features=points.new_zeros(len(points), 0),
            bev=points.new_zeros(0, *grid.shape),
            bev_grid=grid,
            detections=Detections(whole, points.new_zeros(0), rows, rows, rows[:, :2]),
        )
