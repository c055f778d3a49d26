"""Which instance of the truth a detection stands for, and so which points are its members."""

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from most.geometry.boxes import along
from most.membership.roi import Pairs
from most.structures import Detections, Instances


def match_detections(
    detections: Detections, roi: Float[Tensor, "detections 3"], truth: Instances
) -> Int64[Tensor, "detections"]:
    """Return the instance that each detection stands for, -1 for none.

    One to one by confidence: the most confident detection takes the nearest centre of its class inside its RoI
    (a box of half-sizes ``roi`` about the centre, m, turned as the detection is), the next the nearest of those left.
    """
    away = detections.centres[:, None] - truth.centres[None]
    turned = along(away, None if detections.yaws is None else detections.yaws[:, None])
    allowed = (detections.classes[:, None] == truth.classes[None]) & (turned.abs() < roi[:, None]).all(2)
    cost = torch.where(allowed, away.norm(dim=2), torch.inf).cpu().numpy()
    matches = np.full(len(detections), -1)
    for detection in detections.scores.argsort(descending=True, stable=True).tolist():
        if np.isfinite(cost[detection]).any():
            matches[detection] = cost[detection].argmin()
            cost[:, matches[detection]] = np.inf
    return torch.from_numpy(matches).to(roi.device)


def pair_targets(
    pairs: Pairs,
    classes: Int64[Tensor, "detections"],
    matches: Int64[Tensor, "detections"],
    semantics: Int64[Tensor, "points"],
    labels: Int64[Tensor, "points"],
    truth: Instances,
) -> tuple[Float[Tensor, "pairs"], Bool[Tensor, "pairs"]]:
    """Return Y_mem of each pair, 1 for members and 0 for others (paper, Eq. 3), and whether it is known.

    ``semantics`` and ``labels`` are the truth's, ``matches`` those of :func:`match_detections`. A detection that stands
    for no instance has no members, but those pairs are unknown: what learns from them learns to doubt centres, and
    leaves the points of true ones to nobody. Void points are unknown, and so are points of the detection's class
    without an instance: they could be its own.
    """
    keys = torch.cat([truth.keys, truth.keys.new_tensor([-1])])[matches]  # no label is negative
    owned = torch.isin(labels, truth.keys)[pairs.points]
    seen, label = semantics[pairs.points], labels[pairs.points]
    known = (seen != 0) & (owned | (seen != classes[pairs.detections])) & (matches >= 0)[pairs.detections]
    return (label == keys[pairs.detections]).float(), known
