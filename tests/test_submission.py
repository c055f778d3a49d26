"""Packages for the servers: what they hold, and that everything wrong is listed before any is written."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
import torch

import nuscenes_tree
import semantickitti_tree
from most.datasets.nuscenes import PanopticNuScenes, SceneSplits
from most.datasets.reader import Frame, Reader
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.errors import DataError
from most.submission import write_submission


def semantickitti(root: Path) -> Reader:
    return SemanticKITTI(semantickitti_tree.write_tree(root), Splits(train=["00"], val=["08"], test=["11"]))


def nuscenes(root: Path) -> Reader:
    scenes = {"scene-0001": True, "scene-0003": True, "scene-0077": False}
    splits = SceneSplits(train=["scene-0001"], val=["scene-0003"], test=["scene-0077"])
    return PanopticNuScenes(nuscenes_tree.write_tree(root, scenes), splits=splits)


@pytest.fixture(params=[semantickitti, nuscenes])
def reader(request: pytest.FixtureRequest, tmp_path: Path) -> Reader:
    make: Callable[[Path], Reader] = request.param
    return make(tmp_path / "tree")


@pytest.fixture
def folder(reader: Reader, tmp_path: Path) -> Path:
    """Predictions of the test split: first a thing, then stuff."""
    for frame in reader.frames("test"):
        predict(reader, frame, tmp_path / "predictions")
    return tmp_path / "predictions"


def predict(
    reader: Reader, frame: Frame, folder: Path, semantics: list[int] | None = None, ids: list[int] | None = None
) -> Path:
    """Write a frame's labels, all stuff but for those that are given first; return where."""
    taxonomy, points = reader.taxonomy, reader.num_points(frame)
    first, its_id = semantics or taxonomy.things[:1], ids or [1]
    classes = torch.tensor([*first, *taxonomy.stuff[:1] * (points - len(first))])
    numbers = torch.tensor([*its_id, *[0] * (points - len(its_id))])
    path = reader.prediction_path(folder, frame)
    reader.write_prediction(path, taxonomy.encode(classes, numbers))
    return path


def test_a_package_holds_every_scan_of_the_split_and_the_same_bytes_every_time(
    reader: Reader, folder: Path, tmp_path: Path
) -> None:
    frames = reader.frames("test")
    for name in ("a.zip", "b.zip"):
        write_submission(reader, "test", folder, tmp_path / name, progress=False)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.zip") as archive:
        assert archive.testzip() is None
        labels = [name for name in archive.namelist() if not name.endswith((".json", "/"))]
        assert labels == [reader.prediction_path(Path(), frame).as_posix() for frame in frames]
        for name in labels:
            assert archive.read(name) == (folder / name).read_bytes()


def test_names_are_those_that_the_servers_expect(tmp_path: Path) -> None:
    for make, pattern in ((semantickitti, "sequences/11/predictions/"), (nuscenes, "panoptic/test/")):
        reader, folder = make(tmp_path / make.__name__), tmp_path / f"{make.__name__}_predictions"
        frames = reader.frames("test")
        for frame in frames:
            predict(reader, frame, folder)
        write_submission(reader, "test", folder, tmp_path / f"{make.__name__}.zip", progress=False)
        with zipfile.ZipFile(tmp_path / f"{make.__name__}.zip") as archive:
            names = archive.namelist()
            assert sum(name.startswith(pattern) and name != pattern for name in names) == len(frames)
            if make is nuscenes:
                meta = json.loads(archive.read("test/submission.json"))["meta"]
                assert meta == dict.fromkeys(["use_camera", "use_radar", "use_map", "use_external"], False) | {
                    "use_lidar": True, "task": "tracking",
                }  # fmt: skip


def test_everything_that_is_wrong_is_listed_and_nothing_is_written(
    reader: Reader, folder: Path, tmp_path: Path
) -> None:
    """A missing scan, and in another: void, a thing without id, stuff with an id."""
    taxonomy, (first, second, *_) = reader.taxonomy, reader.frames("test")
    missing = reader.prediction_path(folder, first)
    missing.unlink()
    wrong = predict(
        reader, second, folder, [0, 0, taxonomy.things[0], taxonomy.things[0], taxonomy.stuff[0]], [0, 0, 0, 1, 7]
    )
    with pytest.raises(DataError) as refused:
        write_submission(reader, "test", folder, tmp_path / "a.zip", progress=False)
    lines = str(refused.value).splitlines()
    assert lines[0].startswith(f"{missing}: expected")
    assert lines[1:4] == [
        f"{wrong}: expected no void, found 2 such point(s)",
        f"{wrong}: expected no thing without an instance (id 0), found 1 such point(s)",
        f"{wrong}: expected no stuff with an instance, found 1 such point(s)",
    ]
    assert lines[4] == f"{folder}: expected a valid submission, found the 4 problem(s) above"
    assert not (tmp_path / "a.zip").exists()


def test_a_scan_of_another_length_and_a_file_too_many_are_named(reader: Reader, folder: Path, tmp_path: Path) -> None:
    frame = reader.frames("test")[1]
    path, points = reader.prediction_path(folder, frame), reader.num_points(frame)
    reader.write_prediction(path, reader.read_prediction(path)[:-1])
    stray = path.with_name(f"stray{path.suffix}")
    stray.write_bytes(b"")
    with pytest.raises(DataError) as refused:
        write_submission(reader, "test", folder, tmp_path / "a.zip", progress=False)
    assert f"{path}: expected a label for each of the scan's {points} points, found {points - 1}" in str(refused.value)
    assert f"{stray}: expected the predictions of the split's scans alone" in str(refused.value)


def test_a_file_that_is_cut_off_is_named_beside_the_others(reader: Reader, folder: Path, tmp_path: Path) -> None:
    path = reader.prediction_path(folder, reader.frames("test")[0])
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(DataError, match=str(path)) as refused:
        write_submission(reader, "test", folder, tmp_path / "a.zip", progress=False)
    assert "found the 1 problem(s) above" in str(refused.value)


def test_a_split_that_is_not_all_there_is_no_submission(reader: Reader, folder: Path, tmp_path: Path) -> None:
    name = "12" if isinstance(reader, SemanticKITTI) else "scene-0078"
    reader.splits.test.append(name)
    with (
        pytest.warns(UserWarning, match="are not there"),
        pytest.raises(DataError, match=f"of the split test, found no {name};"),
    ):
        write_submission(reader, "test", folder, tmp_path / "a.zip", progress=False)
    assert not (tmp_path / "a.zip").exists()
