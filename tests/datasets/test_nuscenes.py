"""Panoptic nuScenes: a tiny tree with answers worked out by hand."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch

from most.datasets.dataset import WindowDataset
from most.datasets.nuscenes import PanopticNuScenes, SceneSplits, official_scenes
from most.datasets.reader import Frame
from most.datasets.windows import gather_window, previous_frames
from most.errors import DataError
from nuscenes_tree import CAR, NOISE, ROAD, lidar_pose, write_tree

SCENE = "scene-0001"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A training scene, a validation scene and an unlabelled one, by their official names."""
    return write_tree(tmp_path / "nuscenes", {SCENE: True, "scene-0003": True, "scene-0077": False})


@pytest.fixture
def reader(root: Path) -> PanopticNuScenes:
    return PanopticNuScenes(root, splits=SceneSplits(test=["scene-0077"]))


def test_official_scenes() -> None:
    counts = {"v1.0-trainval": (700, 150, 0), "v1.0-mini": (8, 2, 0), "v1.0-test": (0, 0, 150)}
    for version, expected in counts.items():
        scenes = [official_scenes(version, split) for split in ("train", "val", "test")]
        assert tuple(len(set(names)) for names in scenes) == expected
        assert not set(scenes[0]) & set(scenes[1])
    assert official_scenes("v1.0-mini", "val") == ["scene-0103", "scene-0916"]


def test_splits_are_the_official_ones_of_what_is_on_disk(root: Path) -> None:
    reader = PanopticNuScenes(root)
    with pytest.warns(UserWarning, match=r"train: sequences scene-0002, .* and 687 more are not there"):
        assert reader.sequences("train") == [SCENE]
    with pytest.warns(UserWarning, match="val"):
        assert reader.sequences("val") == ["scene-0003"]
    with pytest.raises(DataError, match=r"split test \(v1\.0-trainval has none\).*\n.*v1\.0-test"):
        reader.sequences("test")


def test_scenes_without_a_file_on_disk_are_left_out(root: Path) -> None:
    for path in [*root.rglob("scene-0003-*.bin"), *root.rglob("scene-0003-*.npz")]:
        path.unlink()
    reader = PanopticNuScenes(root, splits=SceneSplits(val=[SCENE, "scene-0003"]))
    with pytest.warns(UserWarning, match="val: sequences scene-0003 are not there"):
        assert reader.sequences("val") == [SCENE]


def test_key_frames_and_the_sweeps_between_them(reader: PanopticNuScenes) -> None:
    assert reader.frames_of(SCENE) == [Frame(SCENE, index) for index in range(5)]
    assert reader.key_frames(SCENE) == [Frame(SCENE, index) for index in (0, 2, 4)]
    sweeps = [reader.sweep(frame) for frame in reader.frames_of(SCENE)]
    assert [sweep.labels is None for sweep in sweeps] == [False, True, False, True, False]
    assert [sweep.time for sweep in sweeps] == [0.0, 0.25, 0.5, 0.75, 1.0]


def test_pose_is_that_of_the_car_times_that_on_it(reader: PanopticNuScenes) -> None:
    for index, pose in enumerate(reader.poses(SCENE)):
        np.testing.assert_allclose(pose, lidar_pose(index), atol=1e-12)


def test_window_lays_previous_sweeps_over_the_current_one(reader: PanopticNuScenes) -> None:
    current = Frame(SCENE, 4)
    before = previous_frames(reader.frames_of(SCENE), current, 2)
    assert before == [Frame(SCENE, 3), Frame(SCENE, 2)]
    window = gather_window(reader.sweep(current), [reader.sweep(frame) for frame in before])
    now, last = window[:8], window[8:16]
    torch.testing.assert_close(last[3:, :3], now[3:, :3])  # what stands still
    torch.testing.assert_close(now[:3, :3] - last[:3, :3], torch.tensor([[-1.0, 0, 0]] * 3))  # 1 m to the sensor's left
    assert last[:, 4].tolist() == [-0.25] * 8


def test_labels_and_intensities(reader: PanopticNuScenes) -> None:
    sweep = reader.sweep(Frame(SCENE, 2))
    assert sweep.labels is not None
    assert sweep.labels[[0, 5, 7]].tolist() == [CAR, ROAD, NOISE]
    assert sweep.points[[0, -1], 3].tolist() == [0.0, 1.0]
    assert reader.taxonomy.to_training(sweep.labels).tolist() == [4, 4, 4, 7, 7, 11, 11, 0]
    assert reader.taxonomy.instance_of(sweep.labels).tolist() == [3, 3, 3, 1, 2, 0, 0, 0]
    assert reader.categories(Frame(SCENE, 2)).tolist() == [17, 17, 17, 3, 2, 24, 24, 0]


def test_boxes_are_in_the_sensor_frame(reader: PanopticNuScenes) -> None:
    boxes = reader.boxes(
        Frame(SCENE, 2)
    )  # the sensor is at (5, 0, 2); its x points along the world's -y, its y along x
    assert (boxes.instances, boxes.categories.tolist(), boxes.counts.tolist()) == (["scene-0001-car"], [17], [3])
    torch.testing.assert_close(boxes.centres, torch.tensor([[-5.0, 7.0, -1.0]], dtype=torch.float64))
    assert boxes.half_sizes.tolist() == [[2.0, 1.0, 0.5]]
    assert boxes.yaws.tolist() == pytest.approx([math.pi / 2])
    assert len(reader.boxes(reader.frames("test")[0])) == 0


def test_prediction_path_is_the_official_one(reader: PanopticNuScenes, tmp_path: Path) -> None:
    path = reader.prediction_path("out", Frame("scene-0003", 2))
    assert path == Path("out/panoptic/val/scene-0003-2_panoptic.npz")
    assert reader.prediction_path("out", Frame("scene-0077", 0)).parent.name == "test"
    mini = PanopticNuScenes(write_tree(tmp_path / "mini", {"scene-0103": True}, version="v1.0-mini"), "v1.0-mini")
    assert mini.prediction_path("out", Frame("scene-0103", 0)).parent.name == "mini_val"
    moved = PanopticNuScenes(reader.root, splits=SceneSplits(train=["scene-0003"], val=[]))
    assert moved.prediction_path("out", Frame("scene-0003", 2)).parent.name == "val"  # as the server knows it
    ours = PanopticNuScenes(write_tree(tmp_path / "ours", {"scene-9999": True}))
    with pytest.raises(DataError, match="scene-9999: expected a scene of a split"):
        ours.prediction_path("out", Frame("scene-9999", 2))


def test_labels_suffice_for_scoring(reader: PanopticNuScenes) -> None:
    for path in reader.root.rglob("*.pcd.bin"):
        path.unlink()
    with pytest.warns(UserWarning, match="are not there"):
        frames = reader.labelled_frames("val")
    assert frames == [Frame("scene-0003", index) for index in (0, 2, 4)]
    assert reader.labels(frames[1])[0] == CAR


def test_tables_are_read_before_loading_starts(reader: PanopticNuScenes) -> None:
    """Or each loading process would read them, gigabytes as they are."""
    dataset = WindowDataset(reader, reader.key_frames(SCENE), previous=2)
    shutil.rmtree(reader.place)
    assert len(dataset[1].points) == 3 * 8
