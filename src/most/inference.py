"""From windows of sweeps to panoptic labels: network, peaks, memberships, fusion (paper, section III, inference)."""

from dataclasses import dataclass, field

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int64
from torch import Tensor, nn

from most.detections import PeakDetector
from most.membership import Evidence, Membership, RegionOfInterest
from most.network import Network, NetworkOutput
from most.panoptic import Fusion, fuse
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

    def modules(self) -> dict[str, nn.Module]:
        """What of this has weights, by the name it has in checkpoints."""
        parts = {"network": self.network, "membership": self.membership}
        return {name: part for name, part in parts.items() if isinstance(part, nn.Module)}

    def __call__(self, samples: list[Sample]) -> list[Prediction]:
        """Label every point of the current sweeps."""
        return [self.fuse(evidence) for evidence in self.see(samples)]

    def see(self, samples: list[Sample]) -> list[Evidence]:
        """Return what stage 1 says of each current sweep, up to the detections."""
        return self.read(self.network(samples), samples)

    def read(self, output: NetworkOutput, samples: list[Sample]) -> list[Evidence]:
        """Return the same from what the network said of the samples."""
        found = self._detect(output, samples)
        classified = classify(output, samples, self.network.grid, self.fallback)
        return [
            Evidence(
                points=sample.points[: sample.num_current, :3],
                semantics=seen.semantics,
                probabilities=seen.probabilities,
                point_features=seen.point_features,
                bev=bev,
                bev_grid=self.network.bev_grid,
                detections=detections,
                offsets=seen.offsets,
            )
            for sample, seen, bev, detections in zip(samples, classified, output.bev, found, strict=True)
        ]

    def _detect(self, output: NetworkOutput, samples: list[Sample]) -> list[Detections]:
        """Return the peaks of each window's maps; nothing is detected where there are none."""
        if output.maps is None:
            return [Detections.none(sample.points) for sample in samples]
        return self.settings.detector(output.maps, self.things, self.network.bev_grid)

    def fuse(self, evidence: Evidence) -> Prediction:
        """Return the labels of one sweep."""
        roi = self.settings.roi
        found = fuse(evidence, self.things, self.membership, roi, self.settings.fusion)
        return Prediction(found.panoptic, found.detections, roi.half_sizes(found.detections.extents), found.claimed)


@dataclass
class Classified:
    """The points of one current sweep as the network classified them."""

    semantics: Int64[Tensor, "current"]
    probabilities: Float[Tensor, "current classes"]
    point_features: Float[Tensor, "current point_channels"]
    offsets: Float[Tensor, "current 3"] | None


def classify(output: NetworkOutput, samples: list[Sample], grid: Grid, fallback: int) -> list[Classified]:
    """Return what each point of the current sweeps is; points out of range read the nearest voxel's class."""
    where = output.voxels.inputs[output.current]
    voxel_classes = output.voxel_logits.argmax(1) + 1
    supervised = torch.zeros(len(output.voxels), dtype=torch.bool, device=where.device)
    supervised[output.voxels.point_voxel[output.current]] = True  # the loss reaches no voxel of past sweeps alone
    start, results = 0, []  # where the window's points begin among the batch's
    for index, sample in enumerate(samples):
        first, last = torch.searchsorted(where, torch.tensor([start, start + sample.num_current], device=where.device))
        inside, rows = where[first:last] - start, slice(int(first), int(last))
        semantics = torch.full((sample.num_current,), fallback, dtype=torch.long, device=where.device)
        semantics[inside] = output.point_logits[rows].argmax(1) + 1
        outside = torch.ones_like(semantics, dtype=torch.bool).index_fill_(0, inside, value=False)
        mine = (output.voxels.coordinates[:, 0] == index) & supervised
        if outside.any() and mine.any():
            points = sample.points[: sample.num_current][outside]
            nearest = nearest_voxel(points, output.voxels.coordinates[mine, 1:], grid)
            semantics[outside] = voxel_classes[mine][nearest]
        probabilities = F.one_hot(semantics - 1, output.point_logits.shape[1]).float()
        probabilities[inside] = output.point_logits[rows].float().softmax(1)
        features = output.point_features.new_zeros(len(semantics), output.point_features.shape[1])
        features[inside] = output.point_features[output.current[rows]]
        offsets = None
        if output.offsets is not None:
            offsets = output.offsets.new_zeros(len(semantics), 3).index_copy(0, inside, output.offsets[rows].detach())
        results.append(Classified(semantics, probabilities, features, offsets))
        start += len(sample.points)
    return results
