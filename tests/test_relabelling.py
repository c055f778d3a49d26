"""most.track through the real command: the truth with instances renamed in every scan gets its identities back."""

import math
import sys
from pathlib import Path

import pytest
import torch

import nuscenes_tree
import semantickitti_tree
from most.datasets.nuscenes import PanopticNuScenes, SceneSplits
from most.datasets.reader import Reader
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.metrics.assignments import Assignments, assignments_path, read_assignments, write_assignments
from most.structures import Detections
from most.track import main

CAR = 1
TOLD = {
    "semantickitti": ["dataset=semantickitti", "dataset.splits.val=['08']"],
    "nuscenes": ["dataset=nuscenes", "dataset.splits.val=[scene-0003]"],
}


@pytest.fixture(params=TOLD)
def reader(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Reader:
    monkeypatch.chdir(tmp_path)
    if request.param == "nuscenes":
        nuscenes_tree.write_tree(tmp_path / "tree", {"scene-0003": True})
        return PanopticNuScenes(tmp_path / "tree", splits=SceneSplits(val=["scene-0003"]))
    semantickitti_tree.write_sequence(tmp_path / "tree", "08", range(4))
    return SemanticKITTI(tmp_path / "tree", Splits(val=["08"]))


@pytest.fixture
def folder(reader: Reader, tmp_path: Path) -> Path:
    """A benchmark entrant's predictions: instances numbered anew in every scan; one in void, a road with a number."""
    for index, frame in enumerate(reader.frames("val")):
        truth, taxonomy = reader.labels(frame), reader.taxonomy
        semantics = taxonomy.to_training(truth)
        _, order = truth.unique(return_inverse=True)
        ids = torch.where(taxonomy.is_thing(semantics), 30 + 17 * index - order, 5)
        labels = taxonomy.encode(semantics, ids)
        labels[:1] = taxonomy.encode(semantics[:1], torch.zeros(1, dtype=torch.int64))  # a thing without a number
        reader.write_prediction(reader.prediction_path(tmp_path / "mine", frame), labels)
    return tmp_path


def command(monkeypatch: pytest.MonkeyPatch, reader: Reader, *arguments: str) -> None:
    told = [*TOLD[reader.taxonomy.name], "dataset.root=tree", "predictions=mine", "out=out"]
    monkeypatch.setattr(sys, "argv", ["track", *told, *arguments])
    main()


def written(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def refused(monkeypatch: pytest.MonkeyPatch, reader: Reader, capsys: pytest.CaptureFixture, *arguments: str) -> str:
    with pytest.raises(SystemExit) as stop:
        command(monkeypatch, reader, *arguments)
    assert stop.value.code == 2
    return str(capsys.readouterr().err)


@pytest.mark.parametrize("tracker", ["greedy", "hungarian", "kalman"])
def test_instances_get_identities_and_all_else_stays(
    folder: Path, reader: Reader, monkeypatch: pytest.MonkeyPatch, tracker: str
) -> None:
    command(monkeypatch, reader, f"tracker={tracker}")
    taxonomy, told = reader.taxonomy, {}
    for frame in reader.frames("val"):
        before = reader.read_prediction(reader.prediction_path(folder / "mine", frame))
        after = reader.read_prediction(reader.prediction_path(folder / "out", frame))
        truth = reader.labels(frame)
        thing = taxonomy.is_thing(taxonomy.decode(before)) & (taxonomy.instance_of(before) > 0)
        assert torch.equal(after[~thing], before[~thing])
        assert torch.equal(taxonomy.decode(after), taxonomy.decode(before))
        for key, label in zip(truth[thing].tolist(), after[thing].tolist(), strict=True):
            told.setdefault(key, set()).add(label)
    assert {len(labels) for labels in told.values()} == {1}
    assert len(set.union(*told.values())) == len(told)


def test_an_interrupted_run_goes_on_to_the_same_bytes(
    folder: Path, reader: Reader, monkeypatch: pytest.MonkeyPatch
) -> None:
    command(monkeypatch, reader)
    whole = written(folder / "out")
    for frame in reader.frames("val")[1:]:
        reader.prediction_path(folder / "out", frame).unlink()
    command(monkeypatch, reader)
    assert written(folder / "out") == whole


def test_detections_beside_the_labels_tell_velocities_and_are_copied(
    folder: Path, reader: Reader, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One car drives 50 m between scans, as its detection says: a velocity that no gate would let pass."""
    if reader.taxonomy.name == "nuscenes":
        pytest.skip("one layout tells")
    for index, frame in enumerate(reader.frames("val")):
        path = reader.prediction_path(folder / "mine", frame)
        where, far = torch.from_numpy(semantickitti_tree.lidar_pose(index)), torch.tensor([50.0 * index, 0, 0])
        turned = (where[:3, :3].T @ torch.tensor([500.0, 0, 0]).double())[:2]
        labels = torch.zeros(len(reader.read_prediction(path)), dtype=torch.int64)
        labels[:3] = reader.taxonomy.encode(torch.full((3,), CAR), torch.tensor([5, 5, 5]))
        centre = where[:3, :3].T @ (far.double() - where[:3, 3])
        found = Detections(torch.tensor([CAR]), torch.tensor([0.5]), centre[None].float(), torch.ones(1, 3),
                           turned[None].float())  # fmt: skip
        claimed = torch.where(labels > 0, 0, -1)
        reader.write_prediction(path, labels)
        write_assignments(assignments_path(path), Assignments(found, torch.ones(1, 3), claimed))
    command(monkeypatch, reader)
    for frame in reader.frames("val"):
        path = reader.prediction_path(folder / "out", frame)
        assert reader.taxonomy.instance_of(reader.read_prediction(path)).unique().tolist() == [0, 1]
        source = assignments_path(reader.prediction_path(folder / "mine", frame))
        assert torch.equal(read_assignments(assignments_path(path)).assigned, read_assignments(source).assigned)


def test_mistakes_are_one_message_and_leave_nothing(
    folder: Path, reader: Reader, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    assert "mine: expected a new or empty folder" in refused(monkeypatch, reader, capsys, "out=mine")
    message = refused(monkeypatch, reader, capsys, "tracker.motion=fast")
    assert "tracker.motion: expected velocity, nearest or kalman, found fast" in message
    path = reader.prediction_path(folder / "mine", reader.frames("val")[-1])
    labels = path.read_bytes()
    path.unlink()
    assert "expected a prediction for each of" in refused(monkeypatch, reader, capsys)
    assert not (folder / "out").exists()
    path.write_bytes(labels)
    command(monkeypatch, reader)
    assert "tracks of other predictions, settings" in refused(monkeypatch, reader, capsys, "tracker=kalman")


def test_labels_that_do_not_fit_the_scan_are_refused_by_name(
    folder: Path, reader: Reader, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    path = reader.prediction_path(folder / "mine", reader.frames("val")[1])
    reader.write_prediction(path, reader.read_prediction(path)[1:])
    message = refused(monkeypatch, reader, capsys)
    assert f"{path.name}: expected a label for each of the scan's" in message
    assert "Traceback" not in message


def test_detections_that_are_nowhere_are_refused_by_file(
    folder: Path, reader: Reader, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    path = reader.prediction_path(folder / "mine", reader.frames("val")[1])
    labels = torch.zeros(len(reader.read_prediction(path)), dtype=torch.int64)
    labels[:3] = reader.taxonomy.encode(torch.full((3,), CAR), torch.tensor([5, 5, 5]))
    nowhere = Detections(torch.tensor([CAR]), torch.tensor([0.5]), torch.full((1, 3), math.nan), torch.ones(1, 3),
                         torch.zeros(1, 2))  # fmt: skip
    reader.write_prediction(path, labels)
    write_assignments(assignments_path(path), Assignments(nowhere, torch.ones(1, 3), torch.where(labels > 0, 0, -1)))
    assert f"{assignments_path(path).name}: centres: expected finite" in refused(monkeypatch, reader, capsys)
