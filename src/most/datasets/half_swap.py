"""Scene-level mixing: two windows, cut in halves by azimuth, make a third (PolarMix, NeurIPS 2022, section 3.2).

A few dozen scans show few places; halves of two of them make a street that no scan shows, at the cost of one.
"""

import math
from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from most.structures import Instances, Sample

OTHER = 1 << 32  # added to the other window's raw labels, 32 bits wide: its instances are none of the first's


def swap_half(sample: Sample, other: Sample, start: float) -> Sample:
    """Replace what lies in the half turn left of azimuth ``start`` (radians, sensor frame) by what ``other`` has there.

    Both are labelled. An instance stays if its modal centre does, with its whole extent; ``counts`` are the points left
    of it. Points whose centre was cut off keep their class.
    """
    mine, theirs = _part(sample, start + math.pi), _part(other, start)
    n, m = mine.num_current, theirs.num_current
    assert mine.labels is not None and theirs.labels is not None  # noqa: PT018
    assert mine.semantics is not None and theirs.semantics is not None  # noqa: PT018
    labels = torch.cat([mine.labels, theirs.labels + OTHER])
    return replace(
        mine,
        points=torch.cat([mine.points[:n], theirs.points[:m], mine.points[n:], theirs.points[m:]]),
        num_current=n + m,
        labels=labels,
        semantics=torch.cat([mine.semantics, theirs.semantics]),
        instances=_join(mine.instances, theirs.instances, labels),
    )


def _part(sample: Sample, start: float) -> Sample:
    """The points, labels and instances left of an azimuth."""
    kept, current = _left_of(sample.points, start), slice(0, sample.num_current)
    instances = sample.instances
    return replace(
        sample,
        points=sample.points[kept],
        num_current=int(kept[current].sum()),
        labels=None if sample.labels is None else sample.labels[kept[current]],
        semantics=None if sample.semantics is None else sample.semantics[kept[current]],
        instances=None if instances is None else instances.select(_left_of(instances.centres, start)),
    )


def _left_of(positions: Float[Tensor, "rows columns"], start: float) -> Bool[Tensor, "rows"]:
    """Whether x, y lie in the half turn that begins at an azimuth."""
    return math.cos(start) * positions[:, 1] > math.sin(start) * positions[:, 0]


def _join(mine: Instances | None, theirs: Instances | None, labels: Tensor) -> Instances | None:
    """Both windows' instances, counted anew in the joined labels; those without a point left go."""
    if mine is None or theirs is None:
        return None
    joined = Instances.cat([mine, replace(theirs, keys=theirs.keys + OTHER)])
    counts = (labels[:, None] == joined.keys).sum(0)
    return replace(joined, counts=counts).select(counts > 0)
