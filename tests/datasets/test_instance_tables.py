"""Instance tables of a reader: kept on disk, and made anew when what they were made from changes."""

from pathlib import Path

import numpy as np
import pytest

from most.datasets.instances import InstanceTables
from most.datasets.reader import Frame
from most.datasets.semantickitti import SemanticKITTI
from most.errors import DataError
from most.geometry.similarity import Similarity
from most.modal.extent import ShrinkWrap


def tables(tree: Path) -> InstanceTables:
    return InstanceTables(SemanticKITTI(tree), ShrinkWrap(), tree / "tables")


def test_table_is_kept_and_follows_its_sources(tree: Path) -> None:
    still = Similarity.identity()
    assert tables(tree)(Frame("00", 1), still).counts.tolist() == [2, 4]
    (path,) = (tree / "tables").rglob("00.npz")
    made = path.stat().st_mtime_ns
    tables(tree).table("00")
    assert path.stat().st_mtime_ns == made
    labels = tree / "sequences/00/labels/000001.label"
    values = np.fromfile(labels, "<u4")
    values[0] = 40
    values.tofile(labels)
    assert tables(tree)(Frame("00", 1), still).counts.tolist() == [2, 3]
    assert [path.name for path in (tree / "tables").rglob("*.npz")] == ["00.npz"]


def test_unlabelled_sequence_is_refused(tree: Path) -> None:
    with pytest.raises(DataError, match=r"11/labels/000000\.label: expected a file"):
        tables(tree).table("11")
