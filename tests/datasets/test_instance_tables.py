"""Instance tables of a reader: kept on disk, and made anew when what they were made from changes."""

from pathlib import Path

import numpy as np
import pytest

import nuscenes_tree
from most.datasets.instances import InstanceTables
from most.datasets.nuscenes import PanopticNuScenes
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


def test_versions_under_one_root_keep_tables_of_their_own(tmp_path: Path) -> None:
    """The mini version has its scenes under the same names as the full one."""

    def make(version: str) -> dict[Path, int]:
        reader = PanopticNuScenes(tmp_path / "nuscenes", version)
        InstanceTables(reader, ShrinkWrap(), tmp_path / "tables").table("scene-0061")
        return {path: path.stat().st_mtime_ns for path in (tmp_path / "tables").rglob("scene-0061.npz")}

    for version in ("v1.0-mini", "v1.0-trainval"):
        nuscenes_tree.write_tree(tmp_path / "nuscenes", {"scene-0061": True}, version=version)
    assert len(make("v1.0-mini")) == 1
    both = make("v1.0-trainval")
    assert len(both) == 2
    assert make("v1.0-mini") == make("v1.0-trainval") == both
