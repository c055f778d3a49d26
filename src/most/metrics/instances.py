"""The instances of a scan's truth, as the membership accuracy needs them: found from its points alone."""

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.geometry.means import group_means
from most.structures import Instances


def find_instances(
    points: Float[Tensor, "points 3"],
    labels: Int64[Tensor, "points"],
    semantics: Int64[Tensor, "points"],
    taxonomy: Taxonomy,
) -> Instances:
    """The instances of one scan with their modal centres, which is all that matching takes: no extents, no motion."""
    own = taxonomy.is_thing(semantics) & (taxonomy.instance_of(labels) != 0) & points.isfinite().all(1)
    keys, owner, counts = torch.unique(labels[own], return_inverse=True, return_counts=True)
    centres, _ = group_means(points[own].double(), owner, len(keys))
    return Instances(
        keys=keys,
        classes=torch.zeros_like(keys).index_copy_(0, owner, semantics[own]),
        counts=counts,
        centres=centres.float(),
        extents=points.new_zeros(len(keys), 3),
        velocities=points.new_zeros(len(keys), 2),
        velocity_known=torch.zeros_like(keys, dtype=torch.bool),
    )
