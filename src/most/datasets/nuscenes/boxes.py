"""Amodal boxes: the full extent of the things around a key frame, hidden parts included (``sample_annotation``)."""

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from most.datasets.nuscenes.rigid import numbers, rigid
from most.datasets.nuscenes.scenes import Scenes
from most.datasets.nuscenes.tables import Row, Table
from most.datasets.taxonomy import Taxonomy
from most.geometry.poses import invert, yaw
from most.modal.boxes import SequenceBoxes

BOX_TABLES = ("sample_annotation", "instance", "category")
_ANNOTATION: dict[str, type] = {
    "sample_token": str,
    "instance_token": str,
    "translation": list,
    "rotation": list,
    "size": list,
    "num_lidar_pts": int,
}


@dataclass
class AmodalBoxes:
    """The boxes of one key frame, in its sensor frame; upright but for the sensor's own lean."""

    instances: list[str]  # tokens, the same through a scene
    categories: Int64[Tensor, "boxes"]  # raw class ids, 0 to 31
    centres: Float64[Tensor, "boxes 3"]  # m
    half_sizes: Float64[Tensor, "boxes 3"]  # m: along, across, up
    yaws: Float64[Tensor, "boxes"]  # radians from the sensor's x axis to the box's length
    counts: Int64[Tensor, "boxes"]  # lidar points inside, by the annotators' count

    def __len__(self) -> int:
        return len(self.instances)


def join_boxes(frames: list[int], boxes: list[AmodalBoxes], taxonomy: Taxonomy) -> SequenceBoxes:
    """Return the boxes of a scene's key frames, whose numbers are ``frames``, under one another."""
    numbers = {token: number for number, token in enumerate(dict.fromkeys(t for one in boxes for t in one.instances))}
    categories = torch.cat([one.categories for one in boxes])
    return SequenceBoxes(
        frames=torch.tensor([frame for frame, one in zip(frames, boxes, strict=True) for _ in one.instances]).long(),
        objects=torch.tensor([numbers[token] for one in boxes for token in one.instances]).long(),
        classes=taxonomy.to_training(taxonomy.label.join(categories, torch.zeros_like(categories))),
        keys=None,
        centres=torch.cat([one.centres for one in boxes]),
        half_sizes=torch.cat([one.half_sizes for one in boxes]),
        yaws=torch.cat([one.yaws for one in boxes]),
    )


class Annotations:
    """The annotations of a version by sample; tables are read when first needed."""

    def __init__(self, scenes: Scenes) -> None:
        self.scenes = scenes
        self.folder = scenes.folder

    def boxes(self, sample: str, pose: Float64[Tensor, "4 4"]) -> AmodalBoxes:
        """The boxes of a sample in the frame of a sensor at ``pose`` (world_from_sensor)."""
        rows, path = self._of_sample.get(sample, []), self._annotations.path
        poses = invert(pose) @ rigid(rows, path)
        sizes = numbers(rows, "size", 3, path)[:, [1, 0, 2]]  # width, length, height in the table
        return AmodalBoxes(
            instances=[row["instance_token"] for row in rows],
            categories=torch.tensor([self._category(row) for row in rows], dtype=torch.int64),
            centres=poses[:, :3, 3],
            half_sizes=sizes / 2,
            yaws=yaw(poses),
            counts=torch.tensor([row["num_lidar_pts"] for row in rows], dtype=torch.int64),
        )

    @cached_property
    def _annotations(self) -> Table:
        return Table(self.folder / "sample_annotation.json", _ANNOTATION)

    @cached_property
    def _instances(self) -> Table:
        return Table(self.folder / "instance.json", {"category_token": str})

    @cached_property
    def _categories(self) -> Table:
        return Table(self.folder / "category.json", {"name": str, "index": int})

    @cached_property
    def _of_sample(self) -> dict[str, list[Row]]:
        rows = defaultdict(list)
        for row in self._annotations.rows.values():
            self.scenes.check_sample(row["sample_token"], self._annotations.path, row["token"])
            rows[row["sample_token"]].append(row)
        return rows

    def _category(self, row: Row) -> int:
        instance = self._instances.row(row["instance_token"], self._annotations.path, row["token"])
        index: int = self._categories.row(instance["category_token"], self._instances.path, instance["token"])["index"]
        return index
