"""The modal instances of any frame of a dataset: one cached table a sequence, and one extent strategy over them."""

import hashlib
from pathlib import Path

from most.datasets.reader import Frame, Reader
from most.geometry.similarity import Similarity
from most.modal.build import LabelRules
from most.modal.cache import cached_table, fingerprint
from most.modal.instances import ExtentStrategy, InstanceTable
from most.structures import Instances


class InstanceTables:
    """Looks up the instances of a frame; tables are made when first asked for, and kept in ``folder``."""

    def __init__(self, reader: Reader, strategy: ExtentStrategy, folder: str | Path) -> None:
        self.reader = reader
        self.strategy = strategy
        self.folder = Path(folder).expanduser()
        self.tables: dict[str, InstanceTable] = {}

    def __call__(self, frame: Frame, change: Similarity) -> Instances:
        """The frame's instances after ``change`` of its sensor frame."""
        return self.table(frame.sequence).instances(frame.index, self.strategy, change.linear, change.translation)

    def table(self, sequence: str) -> InstanceTable:
        """The table of one sequence, from memory, from disk, or made from its labelled sweeps."""
        if sequence not in self.tables:
            self.tables[sequence] = self._load_or_build(sequence)
        return self.tables[sequence]

    def _load_or_build(self, sequence: str) -> InstanceTable:
        frames, taxonomy = self.reader.annotated(sequence), self.reader.taxonomy
        label = (taxonomy.label.high, taxonomy.label.step)
        meaning = {"raw_ids": taxonomy.raw_ids, "things": taxonomy.things, "label": label}  # what a table depends on
        made_from = fingerprint(*self.reader.sources(sequence), meaning)
        rules = LabelRules(taxonomy.to_training, taxonomy.is_thing, taxonomy.instance_of, self.reader.max_gap)
        path = self.folder / self._tree() / f"{sequence}.npz"
        return cached_table(path, made_from, map(self.reader.sweep, frames), len(frames), rules)

    def _tree(self) -> str:
        """A name for the reader's tree, so that several of one format can keep their tables side by side."""
        place = hashlib.sha256(str(self.reader.place.resolve()).encode()).hexdigest()
        return f"{self.reader.taxonomy.name}-{place[:8]}"
