"""Folders of predictions are scored as the evaluator of one scan would, and what does not fit is refused by name."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch

from most.datasets.reader import Frame
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.errors import DataError
from most.metrics.assignments import Assignments, assignments_path, write_assignments
from most.metrics.folders import evaluate_folder
from most.structures import Detections

GOLDEN = Path(__file__).parents[1] / "goldens" / "semantickitti_pq" / "main"
CAR, MOVING_CAR, PERSON, ROAD = 10, 252, 30, 40  # raw ids


def write(path: Path, labels: list[int] | np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.asarray(labels).astype("<u4").tofile(path)


def label(raw: int, instance: int) -> int:
    return raw | instance << 16


class Tree:
    """A SemanticKITTI tree with labels alone, and a folder of predictions."""

    def __init__(self, folder: Path) -> None:
        self.root, self.predictions = folder / "data", folder / "predictions"

    def add(self, sequence: str, index: int, truth: list[int], prediction: list[int] | None) -> None:
        write(self.root / "sequences" / sequence / "labels" / f"{index:06d}.label", truth)
        if prediction is not None:
            write(self.prediction(sequence, index), prediction)

    def prediction(self, sequence: str, index: int) -> Path:
        return self.predictions / "sequences" / sequence / "predictions" / f"{index:06d}.label"

    def add_scan(self, sequence: str, points: np.ndarray) -> None:
        folder = self.root / "sequences" / sequence
        (folder / "velodyne").mkdir(parents=True)
        np.c_[points, np.zeros(len(points))].astype("<f4").tofile(folder / "velodyne" / "000000.bin")
        identity = "1 0 0 0 0 1 0 0 0 0 1 0"
        (folder / "poses.txt").write_text(identity + "\n")
        (folder / "calib.txt").write_text(f"Tr: {identity}\n")
        (folder / "times.txt").write_text("0.0\n")

    def evaluate(self, *sequences: str) -> dict:
        reader = SemanticKITTI(self.root, Splits(val=list(sequences)))
        return evaluate_folder(reader, reader.labelled_frames("val"), self.predictions, progress=False)


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    return Tree(tmp_path)


def test_a_folder_scores_as_the_official_evaluator_says(tree: Tree) -> None:
    expected = json.loads(GOLDEN.with_suffix(".json").read_text())["expected"]["pq"]
    with np.load(GOLDEN.with_suffix(".npz"), allow_pickle=False) as golden:
        bounds, scenes = golden["frame_offsets"], golden["frame_scene"]
        for index, (first, last) in enumerate(pairwise(bounds)):
            truth, prediction = golden["gt_label"][first:last], golden["pred_label"][first:last]
            tree.add(f"{scenes[index]:02d}", index, truth, prediction)
    report = tree.evaluate(*(f"{scene:02d}" for scene in sorted(set(scenes.tolist()))))

    panoptic, per_class = report["panoptic"], report["panoptic"]["per_class"]
    assert report["scans"] == len(bounds) - 1
    assert panoptic["pq"] == pytest.approx(expected["overall"]["pq_mean"], abs=1e-9)
    assert panoptic["pq_dagger"] == pytest.approx(expected["overall"]["pq_dagger"], abs=1e-9)
    assert panoptic["miou"] == pytest.approx(expected["overall"]["iou_mean"], abs=1e-9)
    assert panoptic["rq_stuff"] == pytest.approx(expected["overall"]["rq_stuff"], abs=1e-9)
    assert list(per_class) == list(expected["per_class"])[1:]
    assert per_class["car"]["tp"] == expected["per_class"]["car"]["tp"]


def test_membership_accuracy_is_unknown_without_detections(tree: Tree) -> None:
    tree.add("08", 0, [label(CAR, 1)] * 3, [label(CAR, 1)] * 3)
    panoptic = tree.evaluate("08")["panoptic"]
    assert panoptic["membership_accuracy"] is None
    assert panoptic["membership_accuracy_contested"] is None
    assert panoptic["per_class"]["car"]["iou"] == 1.0


@pytest.fixture
def cars(tree: Tree) -> Tree:
    """Two cars, at 0 and 4 m, of two and three points, one of which is wrongly assigned; and a car without id."""
    truth = [label(CAR, 1)] * 2 + [label(MOVING_CAR, 2)] * 3 + [label(CAR, 0)]
    tree.add("08", 0, truth, [label(CAR, 1)] * 6)
    detections = Detections(
        torch.tensor([1, 1]), torch.tensor([0.9, 0.8]), torch.tensor([[0.0, 0, 0], [4, 0, 0]]), torch.ones(2, 3),
        torch.zeros(2, 2),
    )  # fmt: skip
    found = Assignments(detections, torch.full((2, 3), 2.5), torch.tensor([0, 0, 0, 1, 1, 0]))
    write_assignments(assignments_path(tree.prediction("08", 0)), found)
    return tree


def test_membership_accuracy_from_detections_and_scans(cars: Tree) -> None:
    """x: 0 0 | 2 (both boxes, wrong for both) 5 5 | 1: four of six pairs are right, neither of the contested two is."""
    cars.add_scan("08", np.array([[0, 0, 0], [0, 0, 0], [2, 0, 0], [5, 0, 0], [5, 0, 0], [1, 0, 0]]))
    panoptic = cars.evaluate("08")["panoptic"]
    assert panoptic["membership_accuracy"] == 4 / 6
    assert panoptic["membership_accuracy_contested"] == 0.0


def test_membership_accuracy_needs_all_scans_and_says_what_is_missing(cars: Tree) -> None:
    with pytest.warns(UserWarning, match=r"no membership accuracy.*000000\.bin"):
        assert cars.evaluate("08")["panoptic"]["membership_accuracy"] is None
    cars.add("08", 1, [ROAD], [ROAD])
    with pytest.warns(UserWarning, match="detections of 1 of 2 scans"):
        assert cars.evaluate("08")["panoptic"]["membership_accuracy"] is None


def test_detections_of_another_scan_are_refused(cars: Tree) -> None:
    cars.add_scan("08", np.zeros((5, 3)))
    cars.add("08", 0, [label(CAR, 1)] * 5, [label(CAR, 1)] * 5)
    with pytest.raises(DataError, match=r"000000\.npz: expected an entry for each of the scan's 5 points, found 6"):
        cars.evaluate("08")


def test_missing_predictions_are_counted_and_the_first_is_named(tree: Tree) -> None:
    tree.add("08", 0, [ROAD], [ROAD])
    tree.add("08", 1, [ROAD], None)
    tree.add("08", 2, [ROAD], None)
    with pytest.raises(DataError, match=r"predictions/000001\.label: .*each of 3 scans.* none for 2"):
        tree.evaluate("08")


def test_a_prediction_of_another_length_is_refused(tree: Tree) -> None:
    tree.add("08", 0, [ROAD] * 4, [ROAD] * 3)
    with pytest.raises(DataError, match=r"predictions/000000\.label: .*4 points, found 3"):
        tree.evaluate("08")


def test_a_file_cut_off_within_a_label_is_refused(tree: Tree) -> None:
    tree.add("08", 0, [ROAD] * 4, [ROAD] * 4)
    path = tree.prediction("08", 0)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(DataError, match=r"predictions/000000\.label: .*multiple of 4 bytes.* found 15"):
        tree.evaluate("08")


def test_unlisted_raw_ids_are_void_and_impossible_ones_are_refused(tree: Tree) -> None:
    tree.add("08", 0, [ROAD] * 100, [ROAD] * 60 + [358] * 40)
    assert tree.evaluate("08")["panoptic"]["per_class"]["road"]["iou"] == 0.6
    tree.add("08", 0, [ROAD] * 2, [ROAD, 359])
    with pytest.raises(DataError, match=r"predictions/000000\.label: .*359"):
        tree.evaluate("08")


def test_a_split_without_labels_is_refused(tree: Tree) -> None:
    (tree.root / "sequences" / "08").mkdir(parents=True)
    with pytest.raises(DataError, match="labels"):
        tree.evaluate("08")
    reader = SemanticKITTI(tree.root, Splits(val=["08"]))
    with pytest.raises(DataError, match="expected predictions of scans, found no scan"):
        evaluate_folder(reader, [], tree.predictions)
    write(tree.prediction("08", 0), [ROAD])
    with pytest.raises(DataError, match=r"labels/000000\.label"):
        evaluate_folder(reader, [Frame("08", 0)], tree.predictions, progress=False)
