"""The truth in place of one stage's result; everything after it stays what it is.

A substitution takes a scene and the truth and returns the scene with one thing exchanged. Detections stand for the
instances that stage 2 is trained with (``match_detections``), once their centres are the truth's one for one.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int64
from torch import Tensor

from most.detections import PeakDetector, decode
from most.ladder.scene import Scene, Truth
from most.membership import Evidence, Pairs, Rating, RegionOfInterest, match_detections, pair_targets
from most.modal.heatmap import HeatmapTargets
from most.modal.targets import bev_targets
from most.structures import BevMaps, Detections, Instances
from most.voxels import BevGrid

Substitution = Callable[[Scene, Truth], Scene]

UNSEEN = 0.05  # half-size of a centre whose extent nothing tells, m


def point_semantics(scene: Scene, truth: Truth) -> Scene:
    """Every point has its class; what the truth does not know stays."""
    return _classified(scene, truth.semantics)


def voxel_semantics(scene: Scene, truth: Truth) -> Scene:
    """Every point has the class of most points in its voxel."""
    return _classified(scene, truth.voxel_semantics)


def _classified(scene: Scene, classes: Int64[Tensor, "points"]) -> Scene:
    evidence, known = scene.evidence, classes != 0
    probabilities = evidence.probabilities.clone()
    probabilities[known] = F.one_hot(classes[known] - 1, probabilities.shape[1]).to(probabilities.dtype)
    semantics = classes.where(known, evidence.semantics)
    return replace(scene, evidence=replace(evidence, semantics=semantics, probabilities=probabilities))


def centres(scene: Scene, truth: Truth) -> Scene:
    """The instances' modal centres are detected; extents and velocities are what the maps say in their cells."""
    instances = truth.instances
    found = Detections(
        classes=instances.classes,
        scores=torch.ones_like(instances.centres[:, 0]),
        centres=instances.centres,
        extents=torch.full_like(instances.extents, UNSEEN),
        velocities=torch.zeros_like(instances.velocities),
    )
    if scene.maps is not None:
        grid = scene.evidence.bev_grid
        x, y = _cells(instances.centres, grid).unbind(1)
        _, found.extents, found.velocities, found.yaws = decode(scene.maps, x, y, grid)
    owners = torch.arange(len(instances), device=found.classes.device)
    return replace(scene, evidence=replace(scene.evidence, detections=found), owners=owners)


def extents(scene: Scene, truth: Truth) -> Scene:
    """Detections that stand for an instance have its extent, and its yaw where boxes are turned."""
    found, known, true = scene.evidence.detections, scene.owners >= 0, truth.instances
    values = found.extents.clone().index_put_((known,), true.extents[scene.owners[known]])
    yaws = None
    if found.yaws is not None or true.yaws is not None:
        right = _yaws(true)[scene.owners[known]]
        yaws = _yaws(found).clone().index_put_((known,), right)
    return _detected(scene, replace(found, extents=values, yaws=yaws))


def _yaws(boxes: Detections | Instances) -> Float[Tensor, "boxes"]:
    return torch.zeros_like(boxes.extents[:, 0]) if boxes.yaws is None else boxes.yaws


def velocities(scene: Scene, truth: Truth) -> Scene:
    """Detections that stand for an instance whose velocity is known have it."""
    found, known = scene.evidence.detections, scene.owners >= 0
    known = known.index_put((known,), truth.instances.velocity_known[scene.owners[known]])
    values = truth.instances.velocities[scene.owners[known]]
    return _detected(scene, replace(found, velocities=found.velocities.clone().index_put_((known,), values)))


def _detected(scene: Scene, detections: Detections) -> Scene:
    return replace(scene, evidence=replace(scene.evidence, detections=detections))


def membership(scene: Scene, truth: Truth) -> Scene:
    """Points in a detection's region belong to it if they are of the instance it stands for."""
    return replace(scene, membership=TrueMembership(truth, scene.owners))


@dataclass
class TrueMembership(Rating):
    """Y_mem instead of O_mem (paper, Eq. 3)."""

    truth: Truth
    owners: Int64[Tensor, "detections"]

    def __call__(self, evidence: Evidence, pairs: Pairs) -> Float[Tensor, "pairs"]:
        """Return 1 for members, else 0; a point whose instance is unknown is no member."""
        truth, classes = self.truth, evidence.detections.classes
        return pair_targets(pairs, classes, self.owners, truth.semantics, truth.labels, truth.instances)[0]


@dataclass
class Peaks:
    """The peaks of the truth's own heat maps are detected, as if the network gave exactly what it is asked for."""

    detector: PeakDetector
    roi: RegionOfInterest
    things: list[int]
    targets: HeatmapTargets  # how the network's were drawn

    def __call__(self, scene: Scene, truth: Truth) -> Scene:
        """Detect; centres, extents and velocities are the targets in the peaks' cells."""
        grid = scene.evidence.bev_grid
        maps = target_maps(truth.instances, grid, self.things, self.targets)
        (found,) = self.detector(maps, self.things, grid)
        owners = match_detections(found, self.roi.half_sizes(found.extents), truth.instances)
        return replace(scene, evidence=replace(scene.evidence, detections=found), owners=owners)


def target_maps(instances: Instances, grid: BevGrid, things: list[int], settings: HeatmapTargets) -> BevMaps:
    """Return the targets of one window as a network without error would write them."""
    targets = bev_targets([instances], grid.lower, grid.cell, grid.shape, things, settings)
    _, x, y = targets.cells.unbind(1)

    def spread(values: Float[Tensor, "centres channels"]) -> Float[Tensor, "1 channels x y"]:
        maps = values.new_zeros(1, values.shape[1], *grid.shape)
        maps[0, :, x, y] = values.T
        return maps

    regressed = (targets.offset, targets.height, targets.extent, targets.velocity)
    turned = () if targets.yaw is None else (targets.yaw,)
    return BevMaps(targets.heatmap.logit(), *map(spread, regressed + turned))


def _cells(places: Float[Tensor, "places 3"], grid: BevGrid) -> Int64[Tensor, "places 2"]:
    """The cell of each place; beyond the map the nearest one."""
    lower, cell = places.new_tensor(grid.lower), places.new_tensor(grid.cell)
    last = torch.tensor(grid.shape, device=places.device) - 1
    return ((places[:, :2] - lower) / cell).floor().long().clamp(min=torch.zeros_like(last), max=last)
