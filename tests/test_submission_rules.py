"""Packages pass the validators' rules, restated in tests/oracles; a package with anything wrong would not."""

import io
import json
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest
import torch

import nuscenes_tree
import semantickitti_tree
from most.datasets.nuscenes import PanopticNuScenes, SceneSplits
from most.datasets.reader import Reader
from most.datasets.semantickitti import SemanticKITTI
from most.submission import write_submission
from oracles.submission_rules import TEST_SEQUENCES, nuscenes_faults, semantickitti_faults

SCENES = ["scene-0077", "scene-0078"]
Files = dict[str, bytes]


def predict(reader: Reader, folder: Path) -> None:
    """Every scan of the test split holds a point of each class, the things under the largest id there is, and stuff."""
    taxonomy = reader.taxonomy
    for frame in reader.frames("test"):
        classes = torch.full((reader.num_points(frame),), taxonomy.stuff[0])
        some = torch.arange(len(classes)) + frame.index
        classes[:-1] = (1 + some % (taxonomy.num_classes - 1))[:-1]
        ids = torch.where(taxonomy.is_thing(classes), min(taxonomy.label.step - 1, 65535), 0)
        reader.write_prediction(reader.prediction_path(folder, frame), taxonomy.encode(classes, ids))


@pytest.fixture
def semantickitti(tmp_path: Path) -> tuple[Path, Callable[[Path], Iterable[str]]]:
    """A package, and its faults."""
    root = tmp_path / "tree"
    for sequence in TEST_SEQUENCES:
        semantickitti_tree.write_sequence(root, str(sequence), range(2), labelled=False)
    reader = SemanticKITTI(root)
    predict(reader, tmp_path / "predictions")
    write_submission(reader, "test", tmp_path / "predictions", tmp_path / "package.zip", progress=False)
    return tmp_path / "package.zip", lambda package: semantickitti_faults(package, root)


@pytest.fixture
def nuscenes(tmp_path: Path) -> tuple[Path, Callable[[Path], Iterable[str]]]:
    """A package, and its faults."""
    root = nuscenes_tree.write_tree(tmp_path / "tree", dict.fromkeys(SCENES, False), version="v1.0-test")
    reader = PanopticNuScenes(root, "v1.0-test", SceneSplits(test=SCENES))
    predict(reader, tmp_path / "predictions")
    write_submission(reader, "test", tmp_path / "predictions", tmp_path / "package.zip", progress=False)
    return tmp_path / "package.zip", lambda package: nuscenes_faults(package, root, "v1.0-test", "test", SCENES)


@pytest.fixture(params=["semantickitti", "nuscenes"])
def packaged(request: pytest.FixtureRequest) -> tuple[Path, Callable[[Path], Iterable[str]]]:
    return request.getfixturevalue(request.param)


def test_packages_pass(packaged: tuple[Path, Callable[[Path], Iterable[str]]]) -> None:
    package, faults = packaged
    assert list(faults(package)) == []


def changed(package: Path, change: Callable[[Files], object]) -> Path:
    """The package with other files."""
    with zipfile.ZipFile(package) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    change(files)
    with zipfile.ZipFile(package.with_name("changed.zip"), "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return package.with_name("changed.zip")


def labels_of(files: Files) -> str:
    return next(name for name in files if name.endswith((".label", ".npz")))


GENERAL: list[Callable[[Files], object]] = [
    lambda files: files.pop(labels_of(files)),
    lambda files: files.update({labels_of(files).replace("0", "7"): b""}),
]


@pytest.mark.parametrize("change", GENERAL)
def test_scans_missing_or_too_many_would_be_found(
    packaged: tuple[Path, Callable[[Path], Iterable[str]]], change: Callable[[Files], object]
) -> None:
    package, faults = packaged
    assert list(faults(changed(package, change)))


def kitti(index: int, label: int) -> Callable[[Files], object]:
    """Set one label."""

    def change(files: Files) -> None:
        labels = np.frombuffer(files[labels_of(files)], "<u4").copy()
        labels[index] = label
        files[labels_of(files)] = labels.tobytes()

    return change


@pytest.mark.parametrize(
    "change",
    [
        lambda files: files.pop("sequences/"),
        lambda files: files.pop("sequences/17/predictions/"),
        lambda files: files.update({labels_of(files): files[labels_of(files)][:-4]}),
        kitti(0, 0),
        kitti(0, 252 | 1 << 16),
        kitti(0, 10),
        kitti(0, 40 | 1 << 16),
    ],
)
def test_faults_of_a_semantickitti_package_would_be_found(
    semantickitti: tuple[Path, Callable[[Path], Iterable[str]]], change: Callable[[Files], object]
) -> None:
    package, faults = semantickitti
    assert list(faults(changed(package, change)))


def data(make: Callable[[np.ndarray], np.ndarray]) -> Callable[[Files], object]:
    """Make one scan's labels anew."""

    def change(files: Files) -> None:
        labels, file = np.load(io.BytesIO(files[labels_of(files)]))["data"], io.BytesIO()
        np.savez(file, data=make(labels))
        files[labels_of(files)] = file.getvalue()

    return change


def meta(change: Callable[[dict[str, object]], object]) -> Callable[[Files], object]:
    """Change what the package says of itself."""

    def changed(files: Files) -> None:
        told = json.loads(files["test/submission.json"])
        change(told["meta"])
        files["test/submission.json"] = json.dumps(told).encode()

    return changed


@pytest.mark.parametrize(
    "change",
    [
        lambda files: files.pop("test/submission.json"),
        meta(lambda told: told.pop("task")),
        meta(lambda told: told.update(task="detection")),
        meta(lambda told: told.pop("use_lidar")),
        meta(lambda told: told.update(use_map="no")),
        data(lambda labels: labels.astype(np.int32)),
        data(lambda labels: labels[:-1]),
        data(lambda labels: labels * 0),
        data(lambda labels: labels * 0 + 17000),
        data(lambda labels: labels * 0 + 4000),
        data(lambda labels: labels * 0 + 11001),
    ],
)
def test_faults_of_a_nuscenes_package_would_be_found(
    nuscenes: tuple[Path, Callable[[Path], Iterable[str]]], change: Callable[[Files], object]
) -> None:
    package, faults = nuscenes
    assert list(faults(changed(package, change)))
