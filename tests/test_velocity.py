"""most.velocity through the real command: two scenes in which a car drives on, tracked well and badly by hand."""

import json
import sys
from pathlib import Path

import pytest
import torch

import nuscenes_tree
from most.datasets.nuscenes import PanopticNuScenes, SceneSplits
from most.datasets.reader import Frame
from most.metrics.assignments import Assignments, assignments_path, write_assignments
from most.structures import Detections
from most.velocity import main

SCENES = ["scene-0003", "scene-0012"]
SPEED = 4.0  # m/s, of the car; it has moved on by 2 m in the next of the three key frames


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The truth predicted; one tracking keeps all identities, the other loses the car in the first scene's end."""
    nuscenes_tree.write_tree(tmp_path / "tree", dict.fromkeys(SCENES, True))
    reader = PanopticNuScenes(tmp_path / "tree", splits=SceneSplits(test=SCENES))
    for name in ("good", "bad"):
        for frame in reader.frames("test"):
            lost = name == "bad" and frame == Frame(SCENES[0], 4)
            write(reader, tmp_path / name, frame, car=8 if lost else 7)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(reader: PanopticNuScenes, folder: Path, frame: Frame, car: int) -> None:
    """Predict a key frame as it is, the car with a number, and its velocity twice too low."""
    raw, path = reader.labels(frame), reader.prediction_path(folder, frame)
    semantics, ids = reader.taxonomy.to_training(raw), reader.taxonomy.instance_of(raw)
    semantics = semantics.where(semantics > 0, reader.taxonomy.stuff[0])
    is_car = raw == nuscenes_tree.CAR
    reader.write_prediction(path, reader.taxonomy.encode(semantics, ids.where(~is_car, car)))
    sweep = reader.sweep(frame)
    heading = sweep.pose[1, :2]  # of the world's y, which it takes
    found = Detections(
        classes=semantics[is_car][:1],
        scores=torch.ones(1),
        centres=sweep.points[is_car, :3].mean(0, keepdim=True),
        extents=torch.ones(1, 3),
        velocities=(SPEED / 2 * heading).float()[None],
    )
    write_assignments(assignments_path(path), Assignments(found, torch.ones(1, 3), is_car.long() - 1))


def command(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> None:
    told = ["dataset=nuscenes", "dataset.root=tree", f"dataset.splits.test=[{','.join(SCENES)}]", "split=test"]
    monkeypatch.setattr(sys, "argv", ["velocity", *told, "dataset.min_points=1", "dataset.tables=tables", *arguments])
    main()


def test_the_report_and_the_tables(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    command(monkeypatch, "velocity=good", "nearest=bad", "out=velocity.json")
    report = json.loads((folder / "velocity.json").read_text())
    assert report["scans"] == 6
    assert set(report["sequences"]) == set(SCENES)
    first, second = (report["sequences"][name] for name in SCENES)
    assert first["velocity"] > first["nearest"]
    assert second["velocity"] == second["nearest"]
    gain = (first["velocity"] - first["nearest"]) / 2
    assert report["lstq"]["difference"] == pytest.approx(gain)
    wide = gain * 12.706 / 1.960 * 2**0.5  # Student's, of two
    assert (report["lstq"]["low"], report["lstq"]["high"]) == pytest.approx((gain - wide, gain + wide), rel=0.03)
    assert report["links"]["moving"] == {"velocity": {"kept": 4, "switched": 0}, "nearest": {"kept": 3, "switched": 1}}
    assert report["links"]["all"]["nearest"] == {"kept": 11, "switched": 1}  # two persons, who stand, beside the car
    error = report["velocity_error"]
    assert (error["objects"], error["predicted"], error["zero"]) == pytest.approx((6, SPEED / 2, SPEED))
    assert set(error["per_class"]) == {"car"}
    assert "| LSTQ, mean" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("labels", "expected the segments of"),
        ("detections", "expected an .npz file of detections"),
        ("missing", "expected a prediction for each of 6 scans"),
        ("one scene", "two sequences or more"),
    ],
)
def test_what_cannot_be_compared_is_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, change: str, message: str
) -> None:
    reader = PanopticNuScenes(folder / "tree", splits=SceneSplits(test=SCENES))
    path = reader.prediction_path("bad", reader.frames("test")[0])
    if change == "labels":
        labels = reader.read_prediction(path)
        labels[0] = labels[-2]  # a point of the car goes to the road
        reader.write_prediction(path, labels)
    if change == "detections":
        assignments_path(reader.prediction_path("good", reader.frames("test")[0])).unlink()
    if change == "missing":
        path.unlink()
    extra = [f"dataset.splits.test=[{SCENES[0]}]"] if change == "one scene" else []
    with pytest.raises(SystemExit) as stop:
        command(monkeypatch, "velocity=good", "nearest=bad", *extra)
    assert stop.value.code == 2
    assert message in capsys.readouterr().err
    assert not Path("velocity.json").exists()
