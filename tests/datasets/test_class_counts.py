"""Points of each class over a split of the tiny tree."""

import pytest

from most.datasets.class_counts import class_counts
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.errors import DataError
from semantickitti_tree import write_sequence

CAR, ROAD = 1, 9


def test_counts_are_those_of_the_labels(tree):
    counts = class_counts(SemanticKITTI(tree, Splits(train=["00"])), "train")
    # four scans: a driving car of 4 points, a parked one of 1, 2, 1, 2 points, 2 points of road, 1 unlabelled
    assert counts[[0, CAR, ROAD]].tolist() == [4, 4 * 4 + 6, 8]
    assert counts.sum() == 34
    assert len(counts) == 20


def test_a_split_is_the_sum_of_its_sequences(tree, add_sequence):
    add_sequence("01", range(2))
    both = class_counts(SemanticKITTI(tree, Splits(train=["00", "01"])), "train")
    alone = [class_counts(SemanticKITTI(tree, Splits(train=[name])), "train") for name in ("00", "01")]
    assert both.tolist() == (alone[0] + alone[1]).tolist()


def test_missing_labels_are_named(tree):
    (tree / "sequences" / "00" / "labels" / "000002.label").unlink()
    with pytest.raises(DataError, match=r"00/labels/000002\.label: expected a label file, found none"):
        class_counts(SemanticKITTI(tree, Splits(train=["00"])), "train")


def test_scans_are_not_read(tmp_path):
    folder = write_sequence(tmp_path, "00", range(1))
    (folder / "velodyne" / "000000.bin").write_bytes(b"no scan")
    assert class_counts(SemanticKITTI(tmp_path, Splits(train=["00"])), "train").sum() == 8
