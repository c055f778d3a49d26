"""The nuScenes devkit, in its own environment, takes a package of ours, and finds the figures that we find."""

import json
import zipfile
from pathlib import Path

import pytest
import torch

from most.datasets.nuscenes import PanopticNuScenes, SceneSplits
from most.metrics.folders import evaluate_folder
from most.simulation import SensorSettings, SimulationSettings, TrafficSettings, simulate
from most.submission import write_submission
from oracles.devkit import devkit, needs_devkit

SCENE = "scene-0003"
SENSOR = SensorSettings([-30.67], [10.67], [32], columns=360, labelled_range=100.0, height=1.84)


@pytest.fixture
def reader(tmp_path: Path) -> PanopticNuScenes:
    """A simulated scene of three key frames."""
    traffic = TrafficSettings(persons=10, driving=8)
    settings = SimulationSettings([SCENE], scans=21, sensor=SENSOR, traffic=traffic, layout="nuscenes")
    simulate(settings, tmp_path / "tree")
    return PanopticNuScenes(tmp_path / "tree", splits=SceneSplits(val=[SCENE]))


def predict(reader: PanopticNuScenes, folder: Path) -> None:
    """The truth, a tenth of it under the label of another point, and every other instance renamed in each scan."""
    taxonomy, draw = reader.taxonomy, torch.Generator().manual_seed(0)
    for number, frame in enumerate(reader.frames("val")):
        truth = reader.labels(frame)
        classes, ids = taxonomy.to_training(truth), taxonomy.instance_of(truth)
        lost = (classes == 0) | (taxonomy.is_thing(classes) & (ids == 0))
        classes[lost], ids[lost] = taxonomy.stuff[0], 0
        labels = taxonomy.encode(classes, ids + (ids % 2 == 1) * 200 * number)
        other = torch.randint(len(labels), (len(labels),), generator=draw)
        wrong = torch.rand(len(labels), generator=draw) < 0.1
        reader.write_prediction(reader.prediction_path(folder, frame), torch.where(wrong, labels[other], labels))


@needs_devkit
def test_the_devkit_takes_a_package_and_finds_the_same_figures(reader: PanopticNuScenes, tmp_path: Path) -> None:
    predict(reader, tmp_path / "mine")
    write_submission(reader, "val", tmp_path / "mine", tmp_path / "package.zip", progress=False)
    with zipfile.ZipFile(tmp_path / "package.zip") as archive:
        archive.extractall(tmp_path / "package")
    asked = (reader.root, reader.version, "val", tmp_path / "package", SCENE, tmp_path / "official")
    done = devkit("devkit_submission.py", *asked)
    assert done.returncode == 0, done.stderr

    official = json.loads((tmp_path / "official" / "tracking-result.json").read_text())
    report = evaluate_folder(reader, reader.labelled_frames("val"), tmp_path / "mine", progress=False)
    assert report["tracking"]["sptq"] > report["tracking"]["ptq"] > 0
    for name, theirs in official["segmentation"]["all"].items():
        assert report["panoptic"][name.lower()] == pytest.approx(theirs, abs=1e-9), name
    for name, theirs in official["tracking"]["all"].items():
        ours = report["tracking"]["s_cls" if name == "mIoU" else name.lower()]
        assert ours == pytest.approx(theirs, abs=1e-6), name
    for name, row in report["panoptic"]["per_class"].items():
        theirs = official["segmentation"][name]
        assert [row["pq"], row["iou"]] == pytest.approx([theirs["PQ"], theirs["IoU"]], abs=1e-9), name


@needs_devkit
def test_the_devkit_refuses_a_package_without_a_scan(reader: PanopticNuScenes, tmp_path: Path) -> None:
    """Which shows that it looks."""
    predict(reader, tmp_path / "package")
    reader.prediction_path(tmp_path / "package", reader.frames("val")[1]).unlink()
    (tmp_path / "package/val").mkdir()
    (tmp_path / "package/val/submission.json").write_bytes(
        reader.submission_notes(reader.frames("val"))["val/submission.json"]
    )
    asked = (reader.root, reader.version, "val", tmp_path / "package", SCENE, tmp_path / "official")
    done = devkit("devkit_submission.py", *asked)
    assert done.returncode != 0
    assert "does not exist" in done.stderr
