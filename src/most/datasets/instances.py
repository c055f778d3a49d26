"""The instances of any frame of a dataset: one cached table a sequence, and one extent strategy over them."""

import hashlib
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

from most.datasets.reader import Frame, Reader
from most.errors import ConfigError
from most.geometry.similarity import Similarity
from most.modal.amodal import Amodal
from most.modal.boxes import BoxedTable
from most.modal.build import LabelRules
from most.modal.cache import cached_boxes, cached_table, fingerprint
from most.modal.instances import Extent, ExtentStrategy, InstanceTable
from most.structures import Instances


class InstanceTables:
    """Looks up the instances of a frame; tables are made when first asked for, and kept in ``folder``."""

    def __init__(self, reader: Reader, extent: Extent, folder: str | Path) -> None:
        self.reader = reader
        self.extent = extent
        self.folder = Path(folder).expanduser()
        self.tables: dict[str, InstanceTable] = {}

    def __call__(self, frame: Frame, change: Similarity) -> Instances:
        """The frame's instances after ``change`` of its sensor frame."""
        return self.table(frame.sequence).instances(frame.index, self.strategy, change.linear, change.translation)

    @cached_property
    def strategy(self) -> ExtentStrategy:
        """The extent strategy, with what it wants to know of the training split; made when first asked for."""
        return self.extent.build(self._training())

    def learn(self) -> None:
        """Ask the training split now, rather than in each of many loading processes."""
        _ = self.strategy

    def table(self, sequence: str) -> InstanceTable:
        """The table of one sequence, from memory, from disk, or made from its labelled sweeps."""
        if sequence not in self.tables:
            self.tables[sequence] = self._load_or_build(sequence)
        return self.tables[sequence]

    def _training(self) -> Iterator[InstanceTable]:
        for sequence in self.reader.sequences("train"):
            yield self.table(sequence)

    def _load_or_build(self, sequence: str) -> InstanceTable:
        frames, taxonomy = self.reader.annotated(sequence), self.reader.taxonomy
        label = (taxonomy.label.high, taxonomy.label.step)
        meaning = {"raw_ids": taxonomy.raw_ids, "things": taxonomy.things, "label": label}  # what a table depends on
        made_from = fingerprint(*self.reader.sources(sequence), meaning)
        rules = LabelRules(taxonomy.to_training, taxonomy.is_thing, taxonomy.instance_of, self.reader.max_gap)
        path = self.folder / self._tree() / f"{sequence}.npz"
        table = cached_table(path, made_from, map(self.reader.sweep, frames), len(frames), rules)
        return self._with_boxes(table, sequence, path, made_from) if isinstance(self.extent, Amodal) else table

    def _with_boxes(self, table: InstanceTable, sequence: str, path: Path, made_from: str) -> BoxedTable:
        made_from = fingerprint(self.reader.box_files(sequence), [], {"table": made_from})
        beside = path.with_name(f"{sequence}.boxes.npz")
        boxes = cached_boxes(beside, made_from, table, lambda: self.reader.sequence_boxes(sequence))
        return BoxedTable.of(table, boxes)

    def _tree(self) -> str:
        """A name for the reader's tree, so that several of one format can keep their tables side by side."""
        place = hashlib.sha256(str(self.reader.place.resolve()).encode()).hexdigest()
        return f"{self.reader.taxonomy.name}-{place[:8]}"


def check_extent(extent: Extent, reader: Reader, split: str) -> None:
    """Refuse amodal extents where a sequence of the split has no boxes."""
    without = [name for name in reader.sequences(split) if isinstance(extent, Amodal) and not reader.box_files(name)]
    if without:
        raise ConfigError(
            f"extent: expected amodal boxes for each sequence of the split {split}, found none for "
            f"{', '.join(without[:3])}{' and others' if len(without) > 3 else ''} in {reader.place}: nuScenes and "
            "simulated trees have them, SemanticKITTI itself has not; choose another extent, such as track_max"
        )
