"""Amodal boxes as a dataset annotates them, and which instance of a table each of them is about."""

from collections import Counter
from dataclasses import dataclass, fields

import numpy as np
import torch
from jaxtyping import Bool, Float64, Int64
from scipy.optimize import linear_sum_assignment
from torch import Tensor

from most.geometry.boxes import along
from most.geometry.poses import yaw
from most.modal.instances import InstanceTable

HAND = 0.05  # m that annotators leave around a thing


@dataclass
class SequenceBoxes:
    """The boxes of a sequence, each in the sensor frame of its sweep; upright but for the sensor's own lean."""

    frames: Int64[Tensor, "boxes"]  # index in the sequence
    objects: Int64[Tensor, "boxes"]  # a number for each object, the same through the sequence
    classes: Int64[Tensor, "boxes"]  # training id
    keys: Int64[Tensor, "boxes"] | None  # raw label of the object's points; None where the dataset does not tell
    centres: Float64[Tensor, "boxes 3"]  # m
    half_sizes: Float64[Tensor, "boxes 3"]  # m: along, across, up
    yaws: Float64[Tensor, "boxes"]  # radians from the sensor's x axis to the box's length


@dataclass
class InstanceBoxes:
    """The box of each row of an instance table, zeros where there is none."""

    known: Bool[Tensor, "rows"]
    centres: Float64[Tensor, "rows 3"]  # sensor frame, m
    half_sizes: Float64[Tensor, "rows 3"]  # m: along, across, up
    yaws: Float64[Tensor, "rows"]  # radians from world heading's x axis to the box's length


@dataclass
class BoxedTable(InstanceTable):
    """An instance table with the box of each row."""

    boxes: InstanceBoxes

    @classmethod
    def of(cls, table: InstanceTable, boxes: InstanceBoxes) -> "BoxedTable":
        """Put boxes beside a table's rows."""
        return cls(**{field.name: getattr(table, field.name) for field in fields(InstanceTable)}, boxes=boxes)


def boxes_of_rows(table: InstanceTable, boxes: SequenceBoxes) -> InstanceBoxes:
    """Return the box of each row: that of its sweep whose object it is."""
    keys = boxes.keys if boxes.keys is not None else keys_of_objects(table, boxes)[boxes.objects]
    sizes = table.starts[1:] - table.starts[:-1]
    frames = torch.repeat_interleave(table.frames, sizes)
    place = {pair: row for row, pair in enumerate(zip(boxes.frames.tolist(), keys.tolist(), strict=True))}
    own = [place.get(pair, -1) for pair in zip(frames.tolist(), table.keys.tolist(), strict=True)]
    rows = torch.tensor(own, dtype=torch.int64)
    known, headings = rows >= 0, torch.repeat_interleave(yaw(table.poses), sizes)
    return InstanceBoxes(
        known=known,
        centres=_chosen(boxes.centres, rows),
        half_sizes=_chosen(boxes.half_sizes, rows),
        yaws=(_chosen(boxes.yaws, rows) + headings).where(known, 0.0),
    )


def keys_of_objects(table: InstanceTable, boxes: SequenceBoxes) -> Int64[Tensor, "objects"]:
    """Return the raw label of each object's points, -1 where it has none, from where boxes and modal centres are.

    All points of an instance lie in its box, and so does their mean. Where boxes of one class overlap, the sequence
    decides: one object is one instance, and the points of instances whose centres lie in their objects' boxes are as
    many as can be.
    """
    votes: Counter[tuple[int, int]] = Counter()
    for frame, index in enumerate(table.frames.tolist()):
        rows, near = table.rows(frame), (boxes.frames == index).nonzero().squeeze(1)
        away = along(table.centres[rows][:, None] - boxes.centres[near], boxes.yaws[near]).abs()
        held = (away <= boxes.half_sizes[near] + HAND).all(2)
        held &= table.classes[rows][:, None] == boxes.classes[near]
        for row, box in held.nonzero().tolist():
            votes[int(table.keys[rows[row]]), int(boxes.objects[near[box]])] += int(table.counts[rows[row]])
    return _one_to_one(votes, int(boxes.objects.max()) + 1 if len(boxes.objects) else 0)


def _one_to_one(votes: Counter[tuple[int, int]], num_objects: int) -> Int64[Tensor, "objects"]:
    """Return the key of each object such that most points agree, -1 for none."""
    keys = sorted({key for key, _ in votes})
    points = np.zeros((len(keys), num_objects))
    for (key, one), number in votes.items():
        points[keys.index(key), one] = number
    found = torch.full((num_objects,), -1)
    rows, objects = linear_sum_assignment(points, maximize=True)
    for row, one in zip(rows.tolist(), objects.tolist(), strict=True):
        if points[row, one]:
            found[one] = keys[row]
    return found


def _chosen(values: Float64[Tensor, "boxes *width"], rows: Int64[Tensor, "rows"]) -> Float64[Tensor, "rows *width"]:
    """Return the values at some rows, zeros where these are -1."""
    return torch.cat([values, values.new_zeros(1, *values.shape[1:])])[rows]
