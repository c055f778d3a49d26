"""Clusters of points as detections that claim them, so that whatever follows a detector follows a clustering, too."""

from collections.abc import Callable

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor

from most.geometry.segments import measure
from most.membership.claims import Claims
from most.membership.evidence import Evidence
from most.structures import Detections

Group = Callable[[int, Float64[np.ndarray, "points 3"]], Int64[np.ndarray, "points"]]


def by_class(
    places: Float[Tensor, "points 3"], semantics: Int64[Tensor, "points"], things: list[int], group: Group
) -> Int64[Tensor, "points"]:
    """Return a cluster for each point of ``things``, counted over all of them; -1 for others, and where not finite.

    ``group(index, places)`` clusters the places of the thing at ``index``, of which there is one at least, from 0
    without gaps.
    """
    clusters, count = torch.full_like(semantics, -1), 0
    finite = places.isfinite().all(1)
    for index, thing in enumerate(things):
        rows = (finite & (semantics == thing)).nonzero().squeeze(1)
        if len(rows):
            found = torch.from_numpy(group(index, places[rows].double().cpu().numpy()))
            clusters[rows] = found.to(clusters.device) + count
            count += int(found.max()) + 1
    return clusters


def claims_of(evidence: Evidence, clusters: Int64[Tensor, "points"]) -> Claims:
    """Return the clusters' instances; ``clusters`` counts them from 0 without gaps, each of one class; -1 for none.

    A cluster is detected at the mean of its points, as far as they reach, as surely as they are of its class (the mean
    probability), and with an unknown velocity (NaN).
    """
    own = clusters >= 0
    row, points, count = clusters[own], evidence.points[own], int(clusters.max()) + 1 if own.any() else 0
    classes = clusters.new_zeros(count).index_copy_(0, row, evidence.semantics[own])
    sure = evidence.probabilities[own].detach().gather(1, classes[row, None] - 1).squeeze(1).double()
    sizes = torch.bincount(row, minlength=count)
    centres, extents = measure(points, row, count)
    found = Detections(
        classes=classes,
        scores=(sure.new_zeros(count).index_add_(0, row, sure) / sizes).float().clamp(max=1.0),
        centres=centres,
        extents=extents,
        velocities=torch.full_like(centres[:, :2], torch.nan),
    )
    order = found.scores.argsort(descending=True, stable=True)
    place = torch.cat([order.argsort(), order.new_tensor([-1])])  # where each cluster stands in that order
    return Claims(found.select(order), place[clusters])
