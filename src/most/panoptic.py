"""Fusion of semantics, detections and memberships into one label a point (paper, inference; Algorithm 1)."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int64
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from torch import Tensor

from most.errors import ConfigError
from most.membership import Claims, Evidence, Membership, RegionOfInterest
from most.membership.rating import best
from most.structures import Detections, Panoptic

UNCLAIMED = ("nearest", "cluster", "zero")


@dataclass
class Fusion:
    """How overlaps are resolved and what becomes of thing points that no centre claims."""

    overlap: str = "confident"  # confident: the most confident membership wins; order: the most confident detection
    unclaimed: str = "nearest"  # nearest: by a region grown by ``reach``, else cluster; cluster; zero: id 0
    reach: float = 1.5
    cluster_radius: float = 0.6  # m, between BEV cells of half that size

    def __post_init__(self) -> None:
        if self.overlap not in ("confident", "order"):
            raise ConfigError(f"inference.fusion.overlap: expected confident or order, found {self.overlap}")
        if self.unclaimed not in UNCLAIMED:
            raise ConfigError(
                f"inference.fusion.unclaimed: expected one of {', '.join(UNCLAIMED)}, found {self.unclaimed}"
            )
        if not self.reach >= 1:
            raise ConfigError(f"inference.fusion.reach: expected a number >= 1, found {self.reach}")
        if not self.cluster_radius > 0:
            raise ConfigError(f"inference.fusion.cluster_radius: expected metres above 0, found {self.cluster_radius}")


@dataclass
class Assignment(Claims):
    """Points and the detections that claim them, before and after the unclaimed are dealt with."""

    panoptic: Panoptic


def fuse(
    evidence: Evidence, things: list[int], membership: Membership, roi: RegionOfInterest, fusion: Fusion
) -> Assignment:
    """Return the panoptic labels of one sweep; ``things`` are training ids."""
    points, semantics = evidence.points, evidence.semantics
    claims = membership.claim(evidence, roi, fusion.overlap)
    ids = claims.claimed + 1
    if fusion.unclaimed != "zero":
        left = torch.isin(semantics, torch.tensor(things, device=semantics.device)) & (claims.claimed < 0)
        ids[left] = _adopt(points[left], semantics[left], claims.detections, roi, fusion)
    return Assignment(claims.detections, claims.claimed, Panoptic(semantics, ids))


def _adopt(
    points: Float[Tensor, "points 3"],
    semantics: Int64[Tensor, "points"],
    detections: Detections,
    roi: RegionOfInterest,
    fusion: Fusion,
) -> Int64[Tensor, "points"]:
    """Give unclaimed points of things the id of a near centre, or of a cluster of their own."""
    ids = torch.zeros(len(points), dtype=torch.long, device=points.device)
    if fusion.unclaimed == "nearest":
        pairs = roi.pairs(points, semantics, detections, fusion.reach)
        distance = (points[pairs.points] - detections.centres[pairs.detections]).norm(dim=1)
        ids = best(len(points), pairs, -distance) + 1
    alone = ids == 0
    ids[alone] = cluster(points[alone], semantics[alone], fusion.cluster_radius) + 1 + len(detections)
    return ids


def cluster(
    points: Float[Tensor, "points 3"], semantics: Int64[Tensor, "points"], radius: float
) -> Int64[Tensor, "points"]:
    """Return connected components, counted from 0: same class, BEV cells of half ``radius`` at most ``radius`` apart.

    Non-finite points of a class make one component among themselves.
    """
    if len(points) == 0:
        return torch.zeros(0, dtype=torch.long, device=points.device)
    ground = np.nan_to_num(points[:, :2].double().cpu().numpy(), nan=1e6, posinf=1e6, neginf=1e6)
    cells = np.concatenate([np.floor(ground * 2 / radius), semantics.cpu().numpy()[:, None] * 1e9], 1)
    occupied, cell_of = np.unique(cells, axis=0, return_inverse=True)
    near = cKDTree(occupied).query_pairs(2.0, output_type="ndarray")
    links = coo_array((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(len(occupied),) * 2)
    component = connected_components(links, directed=False)[1]
    return torch.as_tensor(component[cell_of.reshape(-1)], dtype=torch.long, device=points.device)
