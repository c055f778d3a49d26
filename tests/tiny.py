"""A network small enough to run in milliseconds, and windows of points for it."""

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from most.assembly import build_network, build_predictor
from most.backbones import AsymmetricUNetSmallSettings
from most.datasets.taxonomy import Taxonomy
from most.encoder import PointEncoder
from most.heads import CentreHead, SemanticHead
from most.inference import Inference, Predictor
from most.membership import Evidence, Nearest
from most.structures import Detections, Instances, Sample
from most.voxels import Grid

TAXONOMY = Taxonomy.load("semantickitti")
CAR, PERSON, ROAD = 1, 6, 9
GRID = Grid(voxel_size=[0.5, 0.5, 0.5], lower=[-8.0, -8.0, -2.0], upper=[8.0, 8.0, 2.0])  # 32 x 32 x 8; BEV 4 x 4


def tiny_parts(**changes: Any) -> dict[str, Any]:
    """The parts of a tiny model, some of them exchanged."""
    parts = {
        "grid": GRID,
        "encoder": PointEncoder([8, 4]),
        "backbone": AsymmetricUNetSmallSettings(widths=[4, 4, 8, 8], bev_channels=8),
        "centre_head": CentreHead(channels=8),
        "semantic_head": SemanticHead(),
        "membership": Nearest(),
        "inference": Inference(),
    }
    return parts | changes


def tiny_predictor(seed: int = 0, **changes: Any) -> Predictor:
    """A model with random weights."""
    torch.manual_seed(seed)
    parts = tiny_parts(**changes)
    return build_predictor(build_network(parts, TAXONOMY), parts, TAXONOMY)


def window(points: Tensor, past: Tensor | None = None, index: int = 0) -> Sample:
    """A window without labels of [x, y, z] (m, sensor), and of a sweep 0.1 s before."""
    past = torch.zeros(0, 3) if past is None else past
    xyz = torch.cat([points, past])
    time = torch.zeros(len(xyz), 1)
    time[len(points) :] = -0.1
    return Sample("00", index, torch.cat([xyz, torch.full_like(time, 0.5), time], 1), len(points), None, None, None)


def labelled(points: Tensor, semantics: Tensor, instance: Tensor) -> Sample:
    """A window with its truth: points of instance number 0 are stuff, the others' instances are found in them."""
    sample = window(points)
    raw = TAXONOMY.encode(semantics, instance)
    keys = raw[instance > 0].unique()
    of = [points[raw == key] for key in keys]
    centres = torch.stack([each.mean(0) for each in of]) if of else torch.zeros(0, 3)
    extents = [(each - centre).abs().amax(0) for each, centre in zip(of, centres, strict=True)]
    sample.labels, sample.semantics = raw, semantics
    sample.instances = Instances(
        keys=keys,
        classes=TAXONOMY.to_training(keys),
        counts=torch.tensor([len(each) for each in of], dtype=torch.int64),
        centres=centres,
        extents=torch.stack(extents) if of else torch.zeros(0, 3),
        velocities=torch.zeros(len(of), 2),
        velocity_known=torch.ones(len(of), dtype=torch.bool),
    )
    return sample


def known_evidence(predictor: Predictor, sample: Sample) -> Evidence:
    """What an untrained stage 1 makes of a window, but for classes and detections: those are the truth's."""
    predictor.network.eval()
    with torch.no_grad():
        (evidence,) = predictor.see([sample])
    return enlighten(evidence, sample)


def enlighten(evidence: Evidence, sample: Sample) -> Evidence:
    """The same with the truth's classes and detections."""
    truth = sample.instances
    assert truth is not None
    assert sample.semantics is not None
    scores = torch.linspace(0.9, 0.5, len(truth))
    found = Detections(truth.classes, scores, truth.centres, truth.extents, truth.velocities)
    return replace(evidence, semantics=sample.semantics, detections=found)


def cloud(count: int, seed: int = 0) -> Tensor:
    """Points spread over the whole grid."""
    sides = torch.tensor(GRID.upper) - torch.tensor(GRID.lower)
    return torch.rand(count, 3, generator=torch.Generator().manual_seed(seed)) * sides + torch.tensor(GRID.lower)


def street() -> Sample:
    """Two cars on a road: their modal centres are about (-4.2, 3.2, -0.9) and (4.8, -1.4, -0.9)."""
    generator = torch.Generator().manual_seed(0)
    size = torch.tensor([2.0, 0.8, 0.6])
    middles = torch.tensor([[-4.2, 3.2, -0.9], [4.8, -1.4, -0.9]])
    cars = [middle + size * (2 * torch.rand(40, 3, generator=generator) - 1) for middle in middles]
    road = cloud(200) * torch.tensor([1.0, 1.0, 0.0]) + torch.tensor([0.0, 0.0, -1.7])
    semantics = torch.tensor([CAR] * 80 + [ROAD] * 200)
    return labelled(torch.cat([*cars, road]), semantics, torch.tensor([1] * 40 + [2] * 40 + [0] * 200))
