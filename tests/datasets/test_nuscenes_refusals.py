"""What nuScenes' reader refuses: the file, the row, what was expected and what was found are named."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from most.datasets.nuscenes import NuScenesSettings, PanopticNuScenes, SceneSplits
from most.datasets.nuscenes.files import write_panoptic
from most.datasets.reader import Frame
from most.errors import ConfigError, DataError
from nuscenes_tree import Tables, tables, write_tables, write_tree

SCENE, NOON = "scene-0001", 1_600_000_000_250_000
SWEEP, LABELS = f"samples/LIDAR_TOP/{SCENE}-2.pcd.bin", f"panoptic/v1.0-trainval/{SCENE}-2_panoptic.npz"
LIDAR_1, LIDAR_2 = 2, 4  # rows of the scene's sweeps in sample_data, between those of the camera

pytestmark = pytest.mark.filterwarnings("ignore:.*are not there")


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A training scene and an unlabelled one."""
    return write_tree(tmp_path / "nuscenes", {SCENE: True, "scene-0077": False})


@pytest.fixture
def reader(root: Path) -> PanopticNuScenes:
    return PanopticNuScenes(root)


def read_all(reader: PanopticNuScenes) -> None:
    reader.sequences("train")
    reader.sweep(Frame(SCENE, 2))
    reader.boxes(Frame(SCENE, 2))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"version": "v2"}, r"dataset\.version: expected one of v1\.0-mini, .*, found 'v2'"),
        ({"sweeps": -1}, r"dataset\.sweeps: expected at least 0"),
    ],
)
def test_faulty_settings(options: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        NuScenesSettings(**options)


def test_faulty_scene_names() -> None:
    with pytest.raises(ConfigError, match=r"dataset\.splits\.val: expected names such as scene-0061, found '0061'"):
        SceneSplits(val=["0061"])
    with pytest.raises(ConfigError, match=r"dataset\.splits\.train: expected each .* once, found scene-0061 twice"):
        SceneSplits(train=["scene-0061", "scene-0103", "scene-0061"])


def test_version_that_is_not_there(root: Path) -> None:
    with pytest.raises(DataError, match=r"nuscenes/v1\.0-mini: expected scenes of the split train \(scene-0061, "):
        PanopticNuScenes(root, "v1.0-mini").frames("train")


def test_unlabelled_scene_of_a_labelled_split(root: Path) -> None:
    with pytest.raises(DataError, match=r"panoptic\.json: expected the labels of scene-0077 of the split val"):
        PanopticNuScenes(root, splits=SceneSplits(val=["scene-0077"])).frames("val")


def changed(table: str, row: int, **entries: object) -> Callable[[Tables], object]:
    """Change entries of one row."""
    return lambda rows: rows[table][row].update(entries)


def repeated(table: str) -> Callable[[Tables], object]:
    """Repeat a table's first row under another token."""
    return lambda rows: rows[table].append(rows[table][0] | {"token": "again"})


def without(table: str, row: int) -> Callable[[Tables], object]:
    """Leave one row out."""
    return lambda rows: rows[table].pop(row)


@pytest.mark.parametrize(
    ("change", "table", "token", "asking"),
    [
        (without("sample", 1), "sample", f"{SCENE}-sample-1", f"{SCENE}-1' of sample_data"),
        (changed("sample", 0, scene_token="lost"), "scene", "lost", f"{SCENE}-sample-0' of sample"),
        (changed("sample_data", LIDAR_2, calibrated_sensor_token="lost"), "calibrated_sensor", "lost", f"{SCENE}-2"),
        (without("sensor", 1), "sensor", "camera", "camera-mounted' of calibrated_sensor"),
        (changed("sample_data", LIDAR_2, prev="lost"), "sample_data", "lost", f"{SCENE}-2' of sample_data"),
        (changed("sample_data", LIDAR_2, next="lost"), "sample_data", "lost", f"{SCENE}-2' of sample_data"),
        (without("ego_pose", 2), "ego_pose", f"ego-{SCENE}-2", f"{SCENE}-2' of sample_data"),
        (changed("panoptic", 0, sample_data_token="lost"), "sample_data", "lost", f"{SCENE}-0' of panoptic"),
        (without("instance", 0), "instance", f"{SCENE}-car", f"box-{SCENE}-2' of sample_annotation"),
        (changed("instance", 0, category_token="lost"), "category", "lost", f"{SCENE}-car' of instance"),
        (
            changed("sample_annotation", 0, sample_token="lost"),
            "sample",
            "lost",
            f"box-{SCENE}-0' of sample_annotation",
        ),
    ],
)
def test_dangling_token(root: Path, change: Callable, table: str, token: str, asking: str) -> None:
    rows = tables({SCENE: True})
    change(rows)
    write_tables(root, rows)
    with pytest.raises(DataError, match=rf"/{table}\.json: expected the row '{token}', which row '{asking}"):
        read_all(PanopticNuScenes(root))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (changed("sample_data", LIDAR_2, prev=f"{SCENE}-3"), f"row '{SCENE}-2': prev: expected a sweep before"),
        (changed("sample_data", LIDAR_2, next=f"{SCENE}-1"), f"row '{SCENE}-2': next: expected a sweep after"),
        (changed("sample_data", LIDAR_2, timestamp=NOON), f"found {NOON} in rows '{SCENE}-1' and '{SCENE}-2'"),
        (changed("sample_data", LIDAR_1, is_key_frame=True), f"one key frame .* row '{SCENE}-sample-1' .*, found 2"),
        (changed("sample_data", LIDAR_2, is_key_frame=False), f"one key frame .* row '{SCENE}-sample-1' .*, found 0"),
        (changed("sample_data", LIDAR_2, timestamp="noon"), f"row '{SCENE}-2': timestamp: expected int, found 'noon'"),
        (changed("scene", 0, name=None), f"scene.json: row 'token-{SCENE}': name: expected str, found None"),
        (changed("sample", 1, token=f"{SCENE}-sample-0"), f"sample.json: .* once, found {SCENE}-sample-0 twice"),
        (repeated("scene"), f"scene.json: expected each name once, found {SCENE} twice"),
        (
            repeated("sample_data"),
            f"sample_data.json: .* each filename once, found samples/.*{SCENE}-0.* tw",
        ),
        (repeated("panoptic"), f"panoptic.json: expected each sample_data_token once, found {SCENE}-0 twice"),
        (
            changed("panoptic", 0, filename=LABELS),
            f"panoptic.json: expected each filename once, found {LABELS} twice",
        ),
        (changed("ego_pose", 2, rotation=[2, 0, 0, 0]), f"row 'ego-{SCENE}-2': rotation: expected .* length 1"),
        (changed("ego_pose", 2, translation=[1, 2]), rf"row 'ego-{SCENE}-2': translation: .*3 numbers, found \[1, 2\]"),
        (changed("ego_pose", 2, translation=[1, 2, math.nan]), "translation: expected finite numbers"),
        (changed("calibrated_sensor", 0, translation=[1, 2, "a"]), "row 'lidar-mounted': translation: .*3 numbers"),
        (changed("sample_annotation", 1, size=[1, 2]), f"row 'box-{SCENE}-2': size: expected 3 numbers"),
        (changed("sample_data", LIDAR_2, filename="../a.bin"), "filename: expected a name inside .*, found '../a.bin'"),
        (changed("sample_data", LIDAR_2, filename="/a.bin"), "filename: expected a name inside .*, found '/a.bin'"),
        (changed("sample_data", LIDAR_2, token="../a"), "token: expected a name inside .*, found '../a'"),
        (changed("sample_data", LIDAR_2, token="a/b"), "token: expected a name inside .*, found 'a/b'"),
        (changed("panoptic", 0, filename="a/../../b"), "filename: expected a name inside .*, found 'a/../../b'"),
    ],
)
def test_rows_that_make_no_sense(root: Path, change: Callable, message: str) -> None:
    rows = tables({SCENE: True})
    change(rows)
    write_tables(root, rows)
    with pytest.raises(DataError, match=message):
        read_all(PanopticNuScenes(root))


@pytest.mark.parametrize("table", ["scene", "sample_data", "ego_pose", "sensor", "sample_annotation", "category"])
@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "expected a table of nuScenes, found no file; copy"),
        (b'[{"token": "a"', "expected JSON, found something else .* cut off"),
        (b"\xff\xfe", "expected JSON, found something else"),
        (b"[" * 100_000, "expected JSON, found something else"),
        (b"7", "expected a list of rows"),
        (b"[7]", "expected a list of rows"),
    ],
)
def test_faulty_table(root: Path, table: str, content: bytes | None, message: str) -> None:
    path = root / "v1.0-trainval" / f"{table}.json"
    path.unlink() if content is None else path.write_bytes(content)
    with pytest.raises(DataError, match=rf"v1\.0-trainval/{table}\.json: {message}"):
        read_all(PanopticNuScenes(root))


def archive(**arrays: np.ndarray) -> Callable[[Path], object]:
    """Write another archive."""
    return lambda path: np.savez(path, **arrays)


def cut(size: int) -> Callable[[Path], object]:
    """Keep the first bytes."""
    return lambda path: path.write_bytes(path.read_bytes()[:size])


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        (SWEEP, Path.unlink, f"expected the sweep of sample_data {SCENE}-2, found no file; .*dataset.sweeps=0"),
        (SWEEP, cut(21), f"expected a multiple of 20 bytes .* of sample_data {SCENE}-2, found 21; .*copy it again"),
        (SWEEP, cut(20), "expected a label for each of the scan's 1 points, found 8"),
        (LABELS, Path.unlink, "expected panoptic labels, found no file"),
        (LABELS, cut(80), "expected an archive with the array data, found something else"),
        (LABELS, cut(0), "expected an archive with the array data, found something else"),
        (LABELS, lambda path: np.save(path.open("wb"), np.zeros(8)), "expected an archive with the array data"),
        (LABELS, archive(labels=np.zeros(8, np.uint16)), "expected an archive with the array data"),
        (LABELS, archive(data=np.zeros(8, np.int64)), r"expected data of uint16, .* found int64 of shape \(8,\)"),
        (LABELS, archive(data=np.zeros((8, 1), np.uint16)), r".*found uint16 of shape \(8, 1\)"),
        (LABELS, archive(data=np.array([{}] * 8)), "expected an archive .*allow_pickle=False"),
        (LABELS, archive(data=np.zeros(7, np.uint16)), "expected a label for each of the scan's 8 points, found 7"),
    ],
)
def test_faulty_file(reader: PanopticNuScenes, name: str, change: Callable, message: str) -> None:
    change(reader.root / name)
    where = LABELS if "a label for each" in message else name
    with pytest.raises(DataError, match=f"{where}: {message}"):
        reader.sweep(Frame(SCENE, 2))


def test_sweep_without_labels(reader: PanopticNuScenes) -> None:
    with pytest.raises(DataError, match=rf"panoptic\.json: expected a row for the sweep '{SCENE}-1', found none"):
        reader.labels(Frame(SCENE, 1))


def test_missing_classes(reader: PanopticNuScenes) -> None:
    (reader.root / f"lidarseg/v1.0-trainval/{SCENE}-2_lidarseg.bin").unlink()
    with pytest.raises(DataError, match=r"-2_lidarseg\.bin: expected a file of point classes, found none"):
        reader.categories(Frame(SCENE, 2))


def test_unknown_scene_and_sweep(reader: PanopticNuScenes) -> None:
    with pytest.raises(DataError, match=r"scene\.json: expected the scene scene-0002, found none"):
        reader.frames_of("scene-0002")
    with pytest.raises(DataError, match=rf"sample_data\.json: expected a sweep 5 of {SCENE}, found 5 sweeps"):
        reader.sweep(Frame(SCENE, 5))


def test_sources_need_every_label(reader: PanopticNuScenes) -> None:
    large, _ = reader.sources(SCENE)
    assert all(path.is_file() for path in large)
    (reader.root / LABELS).unlink()
    with pytest.raises(DataError, match=f"{LABELS}: expected a file of {SCENE}, found none"):
        reader.sources(SCENE)


def test_labels_that_do_not_fit_the_format(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"a\.npz: expected labels in 0\.\.65535, found 0\.\.65536"):
        write_panoptic(tmp_path / "a.npz", torch.tensor([0, 65536]))
