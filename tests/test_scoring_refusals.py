"""Through the commands that score and package: predictions and truths that are not what they should be, by name."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import nuscenes_tree
import semantickitti_tree
from most import evaluate, submit
from most.datasets.nuscenes import PanopticNuScenes, SceneSplits
from most.datasets.reader import Reader
from most.datasets.semantickitti import SemanticKITTI, Splits

KITTI_TOLD = ["dataset=semantickitti", "dataset.splits.val=['08']"]
NUSCENES_TOLD = ["dataset=nuscenes", "dataset.splits.val=[scene-0003]"]
COMMANDS = {"evaluate": evaluate.main, "submit": submit.main}

Damage = Callable[[Path], object]


def cut(count: int) -> Damage:
    """Take so many bytes off the end."""
    return lambda path: path.write_bytes(path.read_bytes()[:-count])


def as_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def archive(**arrays: np.ndarray) -> Damage:
    """Put other arrays there."""
    return lambda path: np.savez(path, **arrays)


KITTI_FAULTS: dict[str, Damage] = {
    "missing": Path.unlink,
    "a folder": as_folder,
    "empty": lambda path: path.write_bytes(b""),
    "cut within a label": cut(1),
    "a label short": cut(4),
    "of no class": lambda path: np.full(9, 400, "<u4").tofile(path),
    "text": lambda path: path.write_text("no labels at all"),
}
NUSCENES_FAULTS: dict[str, Damage] = {
    "missing": Path.unlink,
    "a folder": as_folder,
    "empty": lambda path: path.write_bytes(b""),
    "cut off": cut(30),
    "a label short": archive(data=np.full(7, 11000, np.uint16)),
    "of no class": archive(data=np.full(8, 17001, np.uint16)),
    "of another type": archive(data=np.full(8, 11000, np.int32)),
    "of another shape": archive(data=np.full((8, 1), 11000, np.uint16)),
    "under another name": archive(labels=np.full(8, 11000, np.uint16)),
    "of objects": archive(data=np.array([{}] * 8)),
    "text": lambda path: path.write_text("no labels at all"),
}


@pytest.fixture
def kitti(tmp_path: Path) -> Reader:
    return SemanticKITTI(semantickitti_tree.write_tree(tmp_path / "tree"), Splits(val=["08"]))


@pytest.fixture
def nuscenes(tmp_path: Path) -> Reader:
    root = nuscenes_tree.write_tree(tmp_path / "tree", {"scene-0003": True})
    return PanopticNuScenes(root, splits=SceneSplits(val=["scene-0003"]))


def predict(reader: Reader, folder: Path) -> list[Path]:
    """Predictions of road everywhere; where they lie."""
    paths = [reader.prediction_path(folder, frame) for frame in reader.frames("val")]
    for path, frame in zip(paths, reader.frames("val"), strict=True):
        road = np.full(reader.num_points(frame), 40 if isinstance(reader, SemanticKITTI) else 11000)
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(reader, SemanticKITTI):
            road.astype("<u4").tofile(path)
        else:
            np.savez_compressed(path, data=road.astype(np.uint16))
    return paths


class Refusal:
    """Runs a command that has to refuse; nothing may be written then."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
        self.folder, self.monkeypatch, self.capsys = folder, monkeypatch, capsys

    def __call__(self, command: str, *told: str) -> str:
        before = set(self.folder.rglob("*"))
        arguments = ["dataset.root=tree", "predictions=mine", "split=val", "out=new/out", *told]
        self.monkeypatch.setattr(sys, "argv", [command, *arguments])
        with pytest.raises(SystemExit) as stop:
            COMMANDS[command]()
        message: str = self.capsys.readouterr().err
        assert stop.value.code == 2
        assert "Traceback" not in message
        assert set(self.folder.rglob("*")) == before
        return message


@pytest.fixture
def refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> Refusal:
    monkeypatch.chdir(tmp_path)
    return Refusal(tmp_path, monkeypatch, capsys)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("fault", KITTI_FAULTS)
def test_a_faulty_semantickitti_prediction(kitti: Reader, refused: Refusal, command: str, fault: str) -> None:
    path = predict(kitti, refused.folder / "mine")[1]
    KITTI_FAULTS[fault](path)
    assert str(path.relative_to(refused.folder)) in refused(command, *KITTI_TOLD)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("fault", NUSCENES_FAULTS)
def test_a_faulty_nuscenes_prediction(nuscenes: Reader, refused: Refusal, command: str, fault: str) -> None:
    path = predict(nuscenes, refused.folder / "mine")[1]
    NUSCENES_FAULTS[fault](path)
    assert str(path.relative_to(refused.folder)) in refused(command, *NUSCENES_TOLD)


@pytest.mark.parametrize("fault", ["cut within a label", "a label short", "empty", "of no class"])
def test_a_faulty_semantickitti_truth(kitti: Reader, refused: Refusal, fault: str) -> None:
    predicted, truth = predict(kitti, refused.folder / "mine")[1], "tree/sequences/08/labels/000001.label"
    KITTI_FAULTS[fault](refused.folder / truth)
    message = refused("evaluate", *KITTI_TOLD)
    assert ("truth of" if fault == "of no class" else truth) in message
    assert fault == "of no class" or predicted.parent.name not in message


def test_without_the_scan_neither_of_two_lengths_is_the_wrong_one(kitti: Reader, refused: Refusal) -> None:
    predicted = predict(kitti, refused.folder / "mine")[1]
    cut(4)(refused.folder / "tree/sequences/08/labels/000001.label")
    (refused.folder / "tree/sequences/08/velodyne/000001.bin").unlink()
    message = refused("evaluate", *KITTI_TOLD)
    assert f"{predicted.relative_to(refused.folder)}: expected a label for each of the truth's 8 points" in message
    assert "found 9; one of the two is cut off, or of another scan" in message


FAULTS_OF_TRUTH = ["missing", "empty", "cut off", "a label short", "of another type", "of another shape", "of objects"]


@pytest.mark.parametrize("fault", FAULTS_OF_TRUTH)
def test_a_faulty_nuscenes_truth(nuscenes: Reader, refused: Refusal, fault: str) -> None:
    predict(nuscenes, refused.folder / "mine")
    truth = "tree/panoptic/v1.0-trainval/scene-0003-2_panoptic.npz"
    NUSCENES_FAULTS[fault](refused.folder / truth)
    assert truth in refused("evaluate", *NUSCENES_TOLD)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_sequence_named_twice_or_not_there(kitti: Reader, refused: Refusal, command: str) -> None:
    predict(kitti, refused.folder / "mine")
    assert "splits.val: expected each sequence once, found 08" in refused(command, "dataset.splits.val=['08','08']")
    assert "tree/sequences: expected sequences of the split val (05)" in refused(command, "dataset.splits.val=['05']")


def test_scans_are_needed_to_package_and_have_whole_points(kitti: Reader, refused: Refusal) -> None:
    predict(kitti, refused.folder / "mine")
    cut(1)(refused.folder / "tree/sequences/08/velodyne/000001.bin")
    assert "velodyne/000001.bin: expected a multiple of 16 bytes" in refused("submit", *KITTI_TOLD)


@pytest.mark.parametrize(
    ("damage", "message"),
    [(Path.unlink, "found no file"), (cut(1), "expected a multiple of 20 bytes"), (as_folder, "found no file")],
)
def test_a_faulty_nuscenes_sweep(nuscenes: Reader, refused: Refusal, damage: Damage, message: str) -> None:
    predict(nuscenes, refused.folder / "mine")
    sweep = "tree/samples/LIDAR_TOP/scene-0003-2.pcd.bin"
    damage(refused.folder / sweep)
    found = refused("submit", *NUSCENES_TOLD)
    assert sweep in found
    assert message in found
