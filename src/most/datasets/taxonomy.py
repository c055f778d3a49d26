"""What a dataset's labels mean: its classes, which of them are things, their colours, and raw <-> training ids.

A taxonomy is data: one YAML file beside this module, read by :meth:`Taxonomy.load`. A raw label is 32 bits wide: the
lower 16 hold the dataset's own class id, the upper 16 the instance's number.
"""

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
CLASS_BITS = 16
KINDS = ("void", "thing", "stuff")


@dataclass(frozen=True)
class Taxonomy:
    """The classes of one dataset; lists are indexed by training id, and id 0 is void."""

    name: str
    class_names: list[str]
    things: list[int]  # training ids
    stuff: list[int]
    colours: list[list[int]]  # RGB, 0 to 255
    min_points: int  # unmatched segments smaller than this are not counted by the official panoptic quality
    raw_ids: list[list[int]]  # the raw class ids of each class; predictions are written as the first
    raw_table_size: int  # raw class ids from here on are errors; unlisted ones below are void

    @staticmethod
    def load(name: str) -> "Taxonomy":
        """Read the taxonomy of that name that comes with the package; a ConfigError lists the names there are."""
        path = TAXONOMIES / f"{name}.yaml"
        if not path.is_file():
            known = ", ".join(sorted(file.stem for file in TAXONOMIES.glob("*.yaml")))
            raise ConfigError(f"taxonomy: expected one of {known}, found {name!r}")
        return Taxonomy.read(path)

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
        )

    @property
    def num_classes(self) -> int:
        """Classes with void."""
        return len(self.class_names)

    def to_training(self, raw: Int64[Tensor, "*points"], source: object = "labels") -> Int64[Tensor, "*points"]:
        """Training ids of raw labels; ``source`` is what a DataError calls them when an id lies outside the table."""
        classes = raw & ((1 << CLASS_BITS) - 1)
        if classes.numel() and int(classes.max()) >= self.raw_table_size:
            raise DataError(
                f"{source}: expected raw class ids 0..{self.raw_table_size - 1} of {self.name}, "
                f"found {int(classes.max())}; check that these are labels of this dataset"
            )
        return self._training_ids.to(raw.device)[classes]

    def to_raw(self, semantics: Int64[Tensor, "*points"]) -> Int64[Tensor, "*points"]:
        """The raw class id that predictions of each class are written as."""
        return self._written_ids.to(semantics.device)[semantics]

    def encode(self, semantics: Int64[Tensor, "*points"], ids: Int64[Tensor, "*points"]) -> Int64[Tensor, "*points"]:
        """Raw labels of classes and instance numbers (0 for stuff); numbers must fit the format's 16 bits."""
        if ids.numel() and not 0 <= int(ids.min()) <= int(ids.max()) < 1 << CLASS_BITS:
            raise DataError(
                f"instance ids: expected 0..{(1 << CLASS_BITS) - 1}, found {int(ids.min())}..{int(ids.max())}"
            )
        return self.to_raw(semantics) | (ids << CLASS_BITS)

    def instance_of(self, raw: Int64[Tensor, "*points"]) -> Int64[Tensor, "*points"]:
        """The instance's number in a raw label; 0 means that the point belongs to no instance."""
        return raw >> CLASS_BITS

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
        return torch.tensor([raw_ids[0] for raw_ids in self.raw_ids])

    @cached_property
    def _thing_mask(self) -> Bool[Tensor, "classes"]:
        mask = torch.zeros(self.num_classes, dtype=torch.bool)
        mask[self.things] = True
        return mask


def check_content(path: Path, content: Any) -> None:
    """Raise a DataError for the first entry of a taxonomy file that is missing or makes no sense."""
    if not isinstance(content, dict):
        raise DataError(f"{path}: expected a mapping, found {type(content).__name__}")
    for key, kind in {"name": str, "min_points": int, "raw_table_size": int, "classes": list}.items():
        if not isinstance(content.get(key), kind):
            raise DataError(f"{path}: {key}: expected {kind.__name__}, found {content.get(key)!r}")
    taken: dict[int, str] = {}
    for index, entry in enumerate(content["classes"]):
        check_class(f"{path}: classes[{index}]", index, entry, content["raw_table_size"])
        for raw in entry["raw"]:
            if raw in taken:
                raise DataError(f"{path}: raw id {raw}: expected one class, found {taken[raw]} and {entry['name']}")
            taken[raw] = entry["name"]


def check_class(where: str, index: int, entry: Any, table_size: int) -> None:
    """Raise a DataError unless ``entry`` describes one class; the first one, and no other, is void."""
    if not isinstance(entry, dict) or set(entry) != {"name", "kind", "raw", "colour"}:
        raise DataError(f"{where}: expected the keys name, kind, raw, colour, found {entry!r}")
    if entry["kind"] not in KINDS or (entry["kind"] == "void") != (index == 0):
        raise DataError(f"{where}.kind: expected {'void' if index == 0 else 'thing or stuff'}, found {entry['kind']!r}")
    if not is_integers(entry["raw"], table_size) or not entry["raw"]:
        raise DataError(f"{where}.raw: expected ids in 0..{table_size - 1}, found {entry['raw']!r}")
    if not is_integers(entry["colour"], 256) or len(entry["colour"]) != 3:
        raise DataError(f"{where}.colour: expected three numbers in 0..255, found {entry['colour']!r}")


def is_integers(value: Any, end: int) -> bool:
    """Whether ``value`` is a list of integers from 0 up to, not including, ``end``."""
    return isinstance(value, list) and all(type(item) is int and 0 <= item < end for item in value)
