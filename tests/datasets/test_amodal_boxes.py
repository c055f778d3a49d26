"""Amodal boxes of whole sequences: beside simulated sequences of SemanticKITTI's layout, and in nuScenes' tables."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

import nuscenes_tree
import semantickitti_tree
from most.datasets.instances import InstanceTables, check_extent
from most.datasets.nuscenes import PanopticNuScenes, SceneSplits
from most.datasets.reader import Frame
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.errors import ConfigError, DataError
from most.geometry.similarity import Similarity
from most.modal.amodal import Amodal
from most.modal.extent import TrackMax
from semantickitti_tree import CAR, PARKED, TREE_TURN

STILL = Similarity.identity()


def write_boxes(folder: Path, scans: int) -> dict[str, np.ndarray]:
    """The moving car's boxes, which stand along the world's x axis, as the simulator writes them."""
    scan, one = np.arange(scans), np.ones(scans, int)
    arrays = {
        "scan": scan,
        "instance": one * (CAR >> 16),
        "label": one * (CAR & 0xFFFF),
        "centre": np.array([[11.0, 2.5 + index, 0.6] for index in scan]),
        "half_size": np.tile([2.0, 1.0, 0.7], (scans, 1)),
        "yaw": np.zeros(scans),
        "velocity": np.zeros((scans, 2)),
        "points": one,
    }
    np.savez(folder / "boxes.npz", **arrays)
    return arrays


@pytest.fixture
def kitti(tree: Path) -> SemanticKITTI:
    """Boxes beside the training sequence alone."""
    write_boxes(tree / "sequences/00", 4)
    return SemanticKITTI(tree, Splits(train=["00"], val=["08"], test=["11"]))


@pytest.fixture
def nuscenes(tmp_path: Path) -> PanopticNuScenes:
    root = nuscenes_tree.write_tree(tmp_path / "nuscenes", {"scene-0001": True, "scene-0003": True})
    return PanopticNuScenes(root, splits=SceneSplits(train=["scene-0001"], val=["scene-0003"], test=[]))


@pytest.mark.parametrize("index", [0, 3])
def test_a_simulated_box_is_in_the_frame_of_its_sensor(kitti: SemanticKITTI, tmp_path: Path, index: int) -> None:
    """The sensor drives 2 m a scan and turns left; the parked car has no box."""
    seen = InstanceTables(kitti, Amodal(), tmp_path / "tables")(Frame("00", index), STILL)
    row = {key: row for row, key in enumerate(seen.keys.tolist())}
    world = torch.tensor([11.0 - 2 * index, 2.5 + index, 0.6], dtype=torch.float64)
    pose = torch.from_numpy(semantickitti_tree.lidar_pose(index))
    torch.testing.assert_close(seen.centres[row[CAR]], (world @ pose[:3, :3]).float(), atol=1e-5, rtol=0)
    assert seen.extents[row[CAR]].tolist() == pytest.approx([2.0, 1.0, 0.7])
    assert seen.yaws is not None
    assert seen.yaws.tolist() == pytest.approx([-TREE_TURN * index if key == CAR else 0.0 for key in row], abs=1e-6)
    assert seen.extents[row[PARKED]].max() < 1.1


def test_a_nuscenes_box_is_that_of_the_instance_in_it(nuscenes: PanopticNuScenes, tmp_path: Path) -> None:
    """The tables do not say which number the car has in the labels; persons have no boxes in this tree."""
    frame = nuscenes.key_frames("scene-0001")[1]
    seen = InstanceTables(nuscenes, Amodal(), tmp_path / "tables")(frame, STILL)
    row = seen.keys.tolist().index(nuscenes_tree.CAR)
    box = nuscenes.boxes(frame)
    assert torch.equal(seen.centres[row], box.centres[0].float())
    assert seen.extents[row].tolist() == pytest.approx([2.0, 1.0, 0.5])
    assert seen.yaws is not None
    assert seen.yaws[row].item() == pytest.approx(box.yaws[0].item())
    assert (seen.yaws != 0).sum() == 1


def test_boxes_are_kept_beside_the_table_and_follow_their_file(kitti: SemanticKITTI, tmp_path: Path) -> None:
    def centre() -> float:
        return float(InstanceTables(kitti, Amodal(), tmp_path / "tables")(Frame("00", 0), STILL).centres[1, 2])

    before = centre()
    (table, boxes) = sorted((tmp_path / "tables").rglob("*.npz"), key=lambda path: len(path.name))
    assert (table.name, boxes.name) == ("00.npz", "00.boxes.npz")
    made = {path: path.stat().st_mtime_ns for path in (table, boxes)}
    assert centre() == before
    assert {path: path.stat().st_mtime_ns for path in (table, boxes)} == made
    path = tmp_path / "semantickitti/sequences/00/boxes.npz"
    with np.load(path) as file:
        arrays = dict(file)
    np.savez_compressed(path, **arrays | {"centre": arrays["centre"] + 1.0})
    assert centre() == pytest.approx(before + 1.0)
    assert table.stat().st_mtime_ns == made[table]


def test_a_table_without_boxes_is_left_as_it_is(kitti: SemanticKITTI, tmp_path: Path) -> None:
    seen = InstanceTables(kitti, TrackMax(), tmp_path / "tables")(Frame("00", 0), STILL)
    assert seen.yaws is None
    assert [path.name for path in (tmp_path / "tables").rglob("*.npz")] == ["00.npz"]


def test_amodal_extents_are_refused_where_a_sequence_has_no_boxes(kitti: SemanticKITTI) -> None:
    check_extent(Amodal(), kitti, "train")
    check_extent(TrackMax(), kitti, "val")
    with pytest.raises(
        ConfigError, match=r"extent: expected amodal boxes .*split val, found none for 08 in .*track_max"
    ):
        check_extent(Amodal(), kitti, "val")


def test_nuscenes_has_boxes_as_long_as_it_has_annotations(nuscenes: PanopticNuScenes) -> None:
    check_extent(Amodal(), nuscenes, "val")
    (nuscenes.place / "sample_annotation.json").unlink()
    with pytest.raises(ConfigError, match="found none for scene-0003"):
        check_extent(Amodal(), PanopticNuScenes(nuscenes.root, splits=nuscenes.splits), "val")


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda arrays: arrays.pop("yaw"), "expected the arrays scan, .* found none"),
        (lambda arrays: arrays.update(yaw=np.array([{}] * 4, dtype=object)), "expected the arrays"),
        (
            lambda arrays: arrays.update(centre=arrays["centre"][:2]),
            r"centre: expected .*found float64 of shape \(2, 3\)",
        ),
        (lambda arrays: arrays.update(scan=arrays["scan"] + 0.5), "scan: expected integers"),
        (lambda arrays: arrays.update(scan=arrays["scan"] - 1), "scan: expected numbers in 0..6"),
        (lambda arrays: arrays["yaw"].fill(np.nan), "yaw: expected finite numbers"),
    ],
)
def test_other_files_are_refused(
    kitti: SemanticKITTI, spoil: Callable[[dict[str, np.ndarray]], object], message: str
) -> None:
    path = kitti.folder("00") / "boxes.npz"
    arrays = write_boxes(path.parent, 4)
    spoil(arrays)
    np.savez(path, **arrays)  # type: ignore[arg-type]
    with pytest.raises(DataError, match=f"{re.escape(str(path))}: {message}.*simulate the sequence again"):
        kitti.sequence_boxes("00")


def test_a_file_that_is_no_archive_is_refused(kitti: SemanticKITTI) -> None:
    (kitti.folder("00") / "boxes.npz").write_bytes(b"PK\x03\x04 and nothing else")
    with pytest.raises(DataError, match=r"boxes\.npz: expected the arrays"):
        kitti.sequence_boxes("00")
