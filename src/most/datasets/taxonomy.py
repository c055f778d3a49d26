"""What a dataset's labels mean: its classes, which of them are things, their colours, and raw <-> training ids.

A taxonomy is data: one YAML file beside this module, read by :meth:`Taxonomy.load`. A raw label is one number that
holds the dataset's own class id and the instance's number, as the taxonomy's :class:`LabelCode` says.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import torch
import yaml
from jaxtyping import Bool, Int64
from torch import Tensor

from most.errors import ConfigError, DataError

TAXONOMIES = Path(__file__).parent / "taxonomies"
KINDS = ("void", "thing", "stuff")
ENTRIES = {
    "name": str,
    "min_points": int,
    "raw_table_size": int,
    "label": dict,
    "predicted_as": str,
    "evaluator": str,
    "classes": list,
}
CHOICES = {
    "label.high": ("class", "instance"),
    "label.unique_in": ("class", "sequence"),
    "predicted_as": ("raw", "training"),
    "evaluator": ("semantickitti", "nuscenes"),
}


@dataclass(frozen=True)
class LabelCode:
    """How one number holds a class id and an instance's number: ``high * step + low``."""

    high: str  # "class" or "instance": which of the two is multiplied
    step: int  # instance numbers are smaller; class ids too, where they are the low part
    unique_in: str  # "class" or "sequence": what two tracks must share for their numbers to differ

    @property
    def largest(self) -> int:
        """The largest number of an instance."""
        return self.step - 1

    def class_of(self, label: Int64[Tensor, "*points"]) -> Int64[Tensor, "*points"]:
        """The class id in a label."""
        return label // self.step if self.high == "class" else label % self.step

    def instance_of(self, label: Int64[Tensor, "*points"]) -> Int64[Tensor, "*points"]:
        """The instance's number in a label."""
        return label % self.step if self.high == "class" else label // self.step

    def join(self, classes: Int64[Tensor, "*points"], instances: Int64[Tensor, "*points"]) -> Int64[Tensor, "*points"]:
        """The label of a class id and an instance's number."""
        high, low = (classes, instances) if self.high == "class" else (instances, classes)
        return high * self.step + low


@dataclass(frozen=True)
class Taxonomy:
    """The classes of one dataset; lists are indexed by training id, and id 0 is void."""

    name: str
    class_names: list[str]
    things: list[int]  # training ids
    stuff: list[int]
    colours: list[list[int]]  # RGB, 0 to 255
    min_points: int  # unmatched segments smaller than this are not counted by the official panoptic quality
    raw_ids: list[list[int]]  # the raw class ids of each class
    raw_table_size: int  # raw class ids from here on are errors; unlisted ones below are void
    label: LabelCode
    predicted_as: str  # which id a submission holds: "raw", the first of the class's raw ids, or "training"
    gates: list[float]  # m in half a second that a tracker may miss a thing of the class by; 0 where it is none
    boxes: list[list[float]]  # usual length and width, m; of things alone
    evaluator: str  # whose 4D figures: "semantickitti" (LSTQ) or "nuscenes" (PAT, PTQ, TQ, and LSTQ in its version)

    @staticmethod
    def load(name: str) -> "Taxonomy":
        """Read the taxonomy of that name that comes with the package; a ConfigError lists the names there are."""
        known = sorted(file.stem for file in TAXONOMIES.glob("*.yaml"))
        if name not in known:  # a checkpoint's name must not lead to other folders
            raise ConfigError(f"taxonomy: expected one of {', '.join(known)}, found {name!r}")
        return Taxonomy.read(TAXONOMIES / f"{name}.yaml")

    @staticmethod
    def read(path: Path) -> "Taxonomy":
        """Read a taxonomy file; a DataError names the file, the entry, what was expected and what was found."""
        content = yaml.safe_load(path.read_text())
        check_content(path, content)
        classes = content["classes"]
        return Taxonomy(
            name=content["name"],
            class_names=[entry["name"] for entry in classes],
            things=[index for index, entry in enumerate(classes) if entry["kind"] == "thing"],
            stuff=[index for index, entry in enumerate(classes) if entry["kind"] == "stuff"],
            colours=[entry["colour"] for entry in classes],
            min_points=content["min_points"],
            raw_ids=[entry["raw"] for entry in classes],
            raw_table_size=content["raw_table_size"],
            label=LabelCode(*(content["label"][key] for key in ("high", "step", "unique_in"))),
            predicted_as=content["predicted_as"],
            gates=[float(entry.get("gate", 0)) for entry in classes],
            boxes=[[float(side) for side in entry.get("box", [])] for entry in classes],
            evaluator=content["evaluator"],
        )

    @property
    def num_classes(self) -> int:
        """Classes with void."""
        return len(self.class_names)

    def to_training(self, raw: Int64[Tensor, "*points"], source: object = "labels") -> Int64[Tensor, "*points"]:
        """Training ids of raw labels; ``source`` is what a DataError calls them when an id lies outside the table."""
        classes = self.label.class_of(raw)
        self._check(classes, self.raw_table_size, "raw", source)
        return self._training_ids.to(raw.device)[classes]

    def encode(self, semantics: Int64[Tensor, "*points"], ids: Int64[Tensor, "*points"]) -> Int64[Tensor, "*points"]:
        """Labels of a submission from classes and instance numbers, 0 for none.

        Where numbers are too large for the format, each class's are given anew; see :func:`fit_numbers`.
        """
        if ids.numel() and int(ids.min()) < 0:
            raise DataError(f"instance ids: expected numbers >= 0, found {int(ids.min())}")
        if ids.numel() and int(ids.max()) >= self.label.step:
            ids = fit_numbers(semantics, ids, self.label.largest)
        return self.label.join(self._written_ids.to(semantics.device)[semantics], ids)

    def decode(self, labels: Int64[Tensor, "*points"], source: object = "labels") -> Int64[Tensor, "*points"]:
        """Training ids of a submission's labels, whoever wrote it; a DataError names ``source``."""
        if self.predicted_as == "raw":
            return self.to_training(labels, source)
        classes = self.label.class_of(labels)
        self._check(classes, self.num_classes, "predicted", source)
        return classes

    def instance_of(self, raw: Int64[Tensor, "*points"]) -> Int64[Tensor, "*points"]:
        """The instance's number in a label; 0 means that the point belongs to no instance."""
        return self.label.instance_of(raw)

    def is_thing(self, semantics: Int64[Tensor, "*points"]) -> Bool[Tensor, "*points"]:
        """Whether each training id is a thing."""
        return self._thing_mask.to(semantics.device)[semantics]

    @cached_property
    def _training_ids(self) -> Int64[Tensor, "raw"]:
        table = torch.zeros(self.raw_table_size, dtype=torch.int64)
        for index, raw_ids in enumerate(self.raw_ids):
            table[raw_ids] = index
        return table

    @cached_property
    def _written_ids(self) -> Int64[Tensor, "classes"]:
        first = [raw_ids[0] for raw_ids in self.raw_ids]
        return torch.tensor(first if self.predicted_as == "raw" else range(self.num_classes))

    @cached_property
    def _thing_mask(self) -> Bool[Tensor, "classes"]:
        mask = torch.zeros(self.num_classes, dtype=torch.bool)
        mask[self.things] = True
        return mask

    def _check(self, classes: Int64[Tensor, "*points"], end: int, kind: str, source: object) -> None:
        if classes.numel() and int(classes.max()) >= end:
            raise DataError(
                f"{source}: expected {kind} class ids 0..{end - 1} of {self.name}, found {int(classes.max())}; "
                "check that these are labels of this dataset"
            )


def fit_numbers(
    semantics: Int64[Tensor, "*points"], ids: Int64[Tensor, "*points"], largest: int
) -> Int64[Tensor, "*points"]:
    """Number each class's instances from 1 by size, the largest first; those beyond ``largest`` share its number.

    Ids of 0 stay.
    """
    numbered = ids != 0
    classes, end = semantics[numbered], int(ids.max()) + 1
    segments, row, sizes = torch.unique(classes * end + ids[numbered], return_inverse=True, return_counts=True)
    order = sizes.argsort(descending=True, stable=True)
    order = order[(segments[order] // end).argsort(stable=True)]  # by class, then by size
    _, count = torch.unique_consecutive(segments[order] // end, return_counts=True)
    first = (count.cumsum(0) - count).repeat_interleave(count)
    number = torch.empty_like(order)
    number[order] = torch.arange(1, len(order) + 1, device=ids.device) - first
    fitted = torch.zeros_like(ids)
    fitted[numbered] = number[row].clamp(max=largest)
    return fitted


def check_content(path: Path, content: Any) -> None:
    """Raise a DataError for the first entry of a taxonomy file that is missing or makes no sense."""
    if not isinstance(content, dict):
        raise DataError(f"{path}: expected a mapping, found {type(content).__name__}")
    for key, kind in ENTRIES.items():
        if not isinstance(content.get(key), kind):
            raise DataError(f"{path}: {key}: expected {kind.__name__}, found {content.get(key)!r}")
    found = content | {f"label.{key}": value for key, value in content["label"].items()}
    for key, choices in CHOICES.items():
        if found.get(key) not in choices:
            raise DataError(f"{path}: {key}: expected {' or '.join(choices)}, found {found.get(key)!r}")
    if not is_integers([step := content["label"].get("step")], 1 << 31) or step < 2:
        raise DataError(f"{path}: label.step: expected a number above 1, found {step!r}")
    taken: dict[int, str] = {}
    for index, entry in enumerate(content["classes"]):
        check_class(f"{path}: classes[{index}]", index, entry, content["raw_table_size"])
        for raw in entry["raw"]:
            if raw in taken:
                raise DataError(f"{path}: raw id {raw}: expected one class, found {taken[raw]} and {entry['name']}")
            taken[raw] = entry["name"]


def check_class(where: str, index: int, entry: Any, table_size: int) -> None:
    """Raise a DataError unless ``entry`` describes one class; the first one, and no other, is void."""
    keys = ["name", "kind", "raw", "colour"]
    keys += ["gate", "box"] if isinstance(entry, dict) and entry.get("kind") == "thing" else []
    if not isinstance(entry, dict) or set(entry) != set(keys):
        raise DataError(f"{where}: expected the keys {', '.join(keys)}, found {entry!r}")
    if entry["kind"] not in KINDS or (entry["kind"] == "void") != (index == 0):
        raise DataError(f"{where}.kind: expected {'void' if index == 0 else 'thing or stuff'}, found {entry['kind']!r}")
    if not is_integers(entry["raw"], table_size) or not entry["raw"]:
        raise DataError(f"{where}.raw: expected ids in 0..{table_size - 1}, found {entry['raw']!r}")
    if not is_integers(entry["colour"], 256) or len(entry["colour"]) != 3:
        raise DataError(f"{where}.colour: expected three numbers in 0..255, found {entry['colour']!r}")
    if entry["kind"] != "thing":
        return
    if not is_length(entry["gate"]):
        raise DataError(f"{where}.gate: expected metres above 0, found {entry['gate']!r}")
    if not (isinstance(entry["box"], list) and len(entry["box"]) == 2 and all(map(is_length, entry["box"]))):
        raise DataError(f"{where}.box: expected length and width, metres above 0, found {entry['box']!r}")


def is_length(value: Any) -> bool:
    """Whether ``value`` is a positive number."""
    return isinstance(value, int | float) and 0 < value < math.inf


def is_integers(value: Any, end: int) -> bool:
    """Whether ``value`` is a list of integers from 0 up to, not including, ``end``."""
    return isinstance(value, list) and all(type(item) is int and 0 <= item < end for item in value)
