"""What is seen of a sweep before anything is substituted: a model's evidence, or nothing."""

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import torch

from most.inference import Inference, Predictor
from most.ladder.scene import Scene
from most.membership import Evidence, Nearest, match_detections
from most.modal.heatmap import HeatmapTargets
from most.structures import Detections, Instances, Sample
from most.voxels import Grid

BEV_STRIDE = 8  # voxels along the side of a BEV cell, of backbones with four levels


@runtime_checkable
class Look(Protocol):
    """Looks at sweeps whose truth is known."""

    has_model: bool

    @property
    def grid(self) -> Grid:
        """The voxels that classes are voted in."""
        ...

    @property
    def settings(self) -> Inference:
        """How detections and points become labels."""
        ...

    @property
    def targets(self) -> HeatmapTargets:
        """How the truth's heat maps are drawn."""
        ...

    def __call__(self, sample: Sample, instances: Instances) -> Scene:
        """Return what is seen of the current sweep, which has these instances."""
        ...


@dataclass
class ModelLook:
    """The model as it is; the network runs once a sweep, however many rungs there are."""

    predictor: Predictor
    targets: HeatmapTargets = field(default_factory=HeatmapTargets)  # that it was trained with

    has_model = True

    @property
    def grid(self) -> Grid:
        """The model's."""
        return self.predictor.network.grid

    @property
    def settings(self) -> Inference:
        """The model's."""
        return self.predictor.settings

    def __call__(self, sample: Sample, instances: Instances) -> Scene:
        """Run stage 1; detections stand for the instances that training would match them with."""
        output = self.predictor.network([sample])
        (seen,) = self.predictor.read(output, [sample])
        owners = match_detections(seen.detections, self.settings.roi.half_sizes(seen.detections.extents), instances)
        return Scene(seen, output.maps, owners, self.predictor.membership)


@dataclass
class NoModel:
    """Nothing is seen: all is void, nothing is detected, and points would go to the nearest centre."""

    grid: Grid
    settings: Inference
    num_classes: int  # with void
    targets: HeatmapTargets = field(default_factory=HeatmapTargets)

    has_model = False

    def __call__(self, sample: Sample, instances: Instances) -> Scene:
        """Return evidence of nothing."""
        return Scene(self._nothing(sample), None, instances.keys[:0], Nearest())

    def _nothing(self, sample: Sample) -> Evidence:
        points, grid = sample.points[: sample.num_current, :3], self.grid.bev(BEV_STRIDE)
        void = points.new_zeros(len(points), dtype=torch.long)
        return Evidence(
            points=points,
            semantics=void,
            probabilities=points.new_zeros(len(points), self.num_classes - 1),
            point_features=points.new_zeros(len(points), 0),
            bev=points.new_zeros(0, *grid.shape),
            bev_grid=grid,
            detections=Detections.none(points),
        )
