"""What is drawn of the objects of one scan: boxes with an identity and a motion."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from most.datasets.reader import Reader
from most.errors import check_entries
from most.metrics.assignments import Assignments, assignments_path, read_assignments
from most.modal.build import LabelRules, build_table
from most.modal.extent import ShrinkWrap
from most.modal.instances import InstanceTable
from most.structures import Detections, Instances, Sweep
from most.viz.bev import SLOW


@dataclass
class Objects:
    """Boxes in one scan's sensor frame."""

    segments: Int64[Tensor, "objects"]  # identity, as ``agreement.segments`` names it; 0 for none
    classes: Int64[Tensor, "objects"]
    centres: Float[Tensor, "objects 3"]  # m
    half_sizes: Float[Tensor, "objects 3"]  # m
    velocities: Float[Tensor, "objects 2"]  # over the ground, m/s
    moving: Bool[Tensor, "objects"]  # known to be faster than modal centres of standing things seem to be
    yaws: Float[Tensor, "objects"] | None = None  # from x to where half-sizes lie along; None: along the axes

    def __len__(self) -> int:
        return len(self.classes)


def predicted_objects(
    sweep: Sweep, labels: Int64[Tensor, "points"], segments: Int64[Tensor, "points"], path: Path, reader: Reader
) -> Objects:
    """The detections that lie beside the prediction ``path``; without them, the boxes about its instances' points."""
    beside = assignments_path(path)
    if beside.is_file():
        found = read_assignments(beside, reader.taxonomy.num_classes)
        check_entries(beside, len(found.assigned), len(labels), "an entry")
        return _of_detections(found.detections, claimed_segments(found, segments))
    rules = _rules(reader, lambda raw: reader.taxonomy.decode(raw, path))
    table = build_table([replace(sweep, labels=labels)], rules)
    return table_objects(table, sweep.index, reader.taxonomy.instance_of)


def true_table(sweeps: Iterable[Sweep], reader: Reader) -> InstanceTable:
    """The instances of labelled sweeps that follow one another, with their motion."""
    return build_table(sweeps, _rules(reader, reader.taxonomy.to_training))


def table_objects(table: InstanceTable, index: int, number_of: Callable[[Tensor], Tensor]) -> Objects:
    """The instances of the scan ``index``; ``number_of`` a raw label is its instance's part of the segment."""
    here = table.instances(index, ShrinkWrap(), torch.eye(3).double(), torch.zeros(3).double())
    segments = (here.classes << 32) + number_of(here.keys)
    return _objects(here, segments, here.velocity_known)


def claimed_segments(found: Assignments, segments: Int64[Tensor, "points"]) -> Int64[Tensor, "detections"]:
    """The segment that most of each detection's points have, 0 where it claims no point of any."""
    has = (found.assigned >= 0) & (segments != 0)
    pairs, counts = torch.unique(torch.stack([found.assigned[has], segments[has]]), dim=1, return_counts=True)
    ascending = pairs[:, counts.argsort(stable=True)]
    most = dict(zip(*ascending.tolist(), strict=True))  # the last, and so the largest, stays
    return torch.tensor([most.get(row, 0) for row in range(len(found.detections))], dtype=torch.int64)


def _of_detections(found: Detections, segments: Int64[Tensor, "detections"]) -> Objects:
    return _objects(found, segments, torch.ones(len(found), dtype=torch.bool))


def _objects(
    found: Detections | Instances, segments: Int64[Tensor, "objects"], known: Bool[Tensor, "objects"]
) -> Objects:
    moving = known & (found.velocities.norm(dim=1) > SLOW)
    return Objects(segments, found.classes, found.centres, found.extents, found.velocities, moving, found.yaws)


def _rules(reader: Reader, to_training: Callable[[Tensor], Tensor]) -> LabelRules:
    taxonomy = reader.taxonomy
    return LabelRules(to_training, taxonomy.is_thing, taxonomy.instance_of, reader.max_gap)
