"""From windows of sweeps to panoptic labels: network, peaks, memberships, fusion (paper, section III, inference)."""

from dataclasses import dataclass, field

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from most.detections import PeakDetector
from most.membership import RegionOfInterest
from most.network import Network, NetworkOutput
from most.panoptic import Fusion, Membership, fuse
from most.structures import Detections, OnDevice, Panoptic, Sample
from most.voxels import Grid, nearest_voxel


@dataclass
class Inference:
    """Settings of everything that comes after the network."""

    detector: PeakDetector = field(default_factory=PeakDetector)
    roi: RegionOfInterest = field(default_factory=RegionOfInterest)
    fusion: Fusion = field(default_factory=Fusion)


@dataclass
class Prediction(OnDevice):
    """What is said of one sweep."""

    panoptic: Panoptic
    detections: Detections
    roi: Float[Tensor, "detections 3"]  # half-sizes of the regions of interest, m
    claimed: Int64[Tensor, "points"]  # the detection whose member a point is, -1 for none


@dataclass
class Predictor:
    """A network with all that turns its output into labels."""

    network: Network
    things: list[int]  # class ids of the heat map's channels
    fallback: int  # class of every point of a window without a single point in range
    membership: Membership
    settings: Inference

    def __call__(self, samples: list[Sample]) -> list[Prediction]:
        """Label every point of the current sweeps."""
        output = self.network(samples)
        found = self.settings.detector(output.maps, self.things, self.network.bev_grid)
        classified = classify(output, samples, self.network.grid, self.fallback)
        return [self._fuse(*each) for each in zip(samples, classified, found, strict=True)]

    def _fuse(self, sample: Sample, semantics: Int64[Tensor, "current"], detections: Detections) -> Prediction:
        points, roi = sample.points[: sample.num_current, :3], self.settings.roi
        assignment = fuse(points, semantics, self.things, detections, self.membership, roi, self.settings.fusion)
        return Prediction(assignment.panoptic, detections, roi.half_sizes(detections.extents), assignment.claimed)


def classify(output: NetworkOutput, samples: list[Sample], grid: Grid, fallback: int) -> list[Int64[Tensor, "current"]]:
    """Return the class of every point of each current sweep; points out of range read the nearest voxel's."""
    where = output.voxels.inputs[output.current]
    point_classes, voxel_classes = output.point_logits.argmax(1) + 1, output.voxel_logits.argmax(1) + 1
    supervised = torch.zeros(len(output.voxels), dtype=torch.bool, device=where.device)
    supervised[output.voxels.point_voxel[output.current]] = True  # the loss reaches no voxel of past sweeps alone
    start, results = 0, []  # where the window's points begin among the batch's
    for index, sample in enumerate(samples):
        first, last = torch.searchsorted(where, torch.tensor([start, start + sample.num_current], device=where.device))
        semantics = torch.full((sample.num_current,), fallback, dtype=torch.long, device=where.device)
        outside = torch.ones(sample.num_current, dtype=torch.bool, device=where.device)
        semantics[where[first:last] - start] = point_classes[first:last]
        outside[where[first:last] - start] = False
        mine = (output.voxels.coordinates[:, 0] == index) & supervised
        if outside.any() and mine.any():
            points = sample.points[: sample.num_current][outside]
            nearest = nearest_voxel(points, output.voxels.coordinates[mine, 1:], grid)
            semantics[outside] = voxel_classes[mine][nearest]
        results.append(semantics)
        start += len(sample.points)
    return results
