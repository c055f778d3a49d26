"""From the labels of one sweep to what a tracker is told of it, and back to its points."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from most.geometry.boxes import bounds
from most.geometry.segments import measure
from most.structures import Detections, Observations, OnDevice, Panoptic

FARTHEST = 1e3  # m; no lidar of a car reaches there: a point beyond says as little of its segment's place as infinity
UNDETECTED = 0.0  # score of a segment that no detection claims: any detection chooses its track before it


@dataclass
class Segments(OnDevice):
    """The observed segments of one sweep, and where they are among its points."""

    observations: Observations
    rows: Int64[Tensor, "points"]  # the observation that each point belongs to, -1 for none

    def rename(self, identities: Int64[Tensor, "segments"]) -> Int64[Tensor, "points"]:
        """Return each point's track identity, 0 for points of no segment."""
        return torch.cat([identities, identities.new_zeros(1)])[self.rows]


def observe(
    points: Float[Tensor, "points 3"],
    panoptic: Panoptic,
    things: list[int],
    detections: Detections | None = None,
    claimed: Int64[Tensor, "points"] | None = None,
) -> Segments:
    """Return the segments of things in one sweep: points of one class and one id other than 0, whatever the numbers.

    ``detections`` and ``claimed`` (the detection whose member a point is, -1 for none) come together. The detection
    that claims most of a segment's points lends it centre, extent, score, and velocity if it has one. Where none does
    (unclaimed points, predictions of others) they come from the points: their mean, their reach, no velocity, and the
    lowest score.
    Ids are not read for that: they are numbers of ``panoptic.fuse`` only until somebody renames them.
    """
    classes, rows = _segments(panoptic, things)
    seen = _by_points(points, classes, rows)
    if detections is not None and claimed is not None and len(detections) and len(seen):
        seen = _by_detections(seen, rows, detections, claimed)
    return Segments(seen, rows)


def _segments(panoptic: Panoptic, things: list[int]) -> tuple[Int64[Tensor, "segments"], Int64[Tensor, "points"]]:
    """Return each segment's class, and the segment of each point, -1 for none."""
    semantics, ids = panoptic.semantics, panoptic.ids
    own = torch.isin(semantics, torch.tensor(things, device=semantics.device)) & (ids != 0)
    named, name = torch.unique(ids[own], return_inverse=True)
    keys, row = torch.unique(semantics[own] * len(named) + name, return_inverse=True)  # by pairs, it takes far longer
    rows = torch.full_like(semantics, -1)
    rows[own] = row
    return keys // max(len(named), 1), rows


def _by_points(
    points: Float[Tensor, "points 3"], classes: Int64[Tensor, "segments"], rows: Int64[Tensor, "points"]
) -> Observations:
    """Observe segments by their points that are somewhere; one that has none is nowhere."""
    own = (rows >= 0) & (points.abs() <= FARTHEST).all(1)
    count = len(classes)
    centres, extents = measure(points[own], rows[own], count)
    return Observations(
        classes=classes,
        centres=centres,
        extents=extents,
        velocities=points.new_zeros(count, 2, dtype=torch.float32),
        velocity_known=torch.zeros_like(classes, dtype=torch.bool),
        scores=points.new_full((count,), UNDETECTED, dtype=torch.float32),
        placed=torch.bincount(rows[own], minlength=count) > 0,
    )


def _by_detections(
    seen: Observations, rows: Int64[Tensor, "points"], detections: Detections, claimed: Int64[Tensor, "points"]
) -> Observations:
    """Replace what points say of a segment by what the detection of its class says that claims most of them."""
    both = (rows >= 0) & (claimed >= 0)
    votes = torch.bincount(rows[both] * len(detections) + claimed[both], minlength=len(seen) * len(detections))
    most, best = votes.reshape(len(seen), len(detections)).max(1)
    found = ((most > 0) & (detections.classes[best] == seen.classes)).nonzero().squeeze(1)
    lent = detections.select(best[found])
    lent.extents = bounds(lent.extents, lent.yaws)
    for name in ("centres", "extents", "velocities", "scores"):
        setattr(seen, name, getattr(seen, name).index_copy(0, found, getattr(lent, name).float()))
    seen.placed = seen.placed.index_fill(0, found, value=True)
    seen.velocity_known = seen.velocity_known.index_copy(0, found, lent.velocities.isfinite().all(1))
    seen.velocities = seen.velocities.nan_to_num(0.0)
    return seen
