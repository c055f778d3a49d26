"""Panoptic nuScenes on real key frames: poses, boxes and labels agree with the points."""

import os
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree
from torch import Tensor

from most.datasets.instances import InstanceTables
from most.datasets.nuscenes import PanopticNuScenes, SceneSplits
from most.datasets.reader import Frame
from most.geometry.boxes import along
from most.geometry.poses import relative, transform, yaw
from most.modal.amodal import Amodal
from most.modal.boxes import BoxedTable

REAL = os.environ.get("MOST_REAL_DATA")
SCENE = "scene-1072"
HAND = 0.05  # m that annotators leave around a thing

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not REAL, reason="MOST_REAL_DATA is unset: it names the folder of the unpacked real scans"),
]


@pytest.fixture(scope="module")
def reader() -> PanopticNuScenes:
    return PanopticNuScenes(Path(str(REAL)) / "nuscenes", splits=SceneSplits(val=[SCENE]))


@pytest.mark.parametrize(("source", "target", "limit"), [(3, 4, 0.15), (12, 13, 0.15), (4, 7, 0.35)])
def test_manmade_points_of_one_key_frame_fall_onto_another(
    reader: PanopticNuScenes, source: int, target: int, limit: float
) -> None:
    one, other = (reader.sweep(Frame(SCENE, index)) for index in (source, target))
    manmade = reader.taxonomy.class_names.index("manmade")
    walls = [s.points[reader.taxonomy.to_training(s.labels) == manmade, :3] for s in (one, other)]
    tree, pose = cKDTree(walls[1].numpy()), relative(other.pose, one.pose)

    def distance(pose: Tensor) -> float:
        return float(np.median(tree.query(transform(pose, walls[0][::2]).numpy())[0]))

    aside = pose.clone()
    aside[:2, 3] += 0.5
    assert distance(pose) <= limit
    assert distance(aside) > 1.5 * limit  # the measure would notice a pose that is off
    assert distance(torch.eye(4, dtype=torch.float64)) > 1.5 * limit


def test_points_of_a_box_are_of_its_category(reader: PanopticNuScenes) -> None:
    agreeing = total = 0
    for frame in reader.key_frames(SCENE)[::5]:
        sweep, boxes = reader.sweep(frame), reader.boxes(frame)
        assert sweep.labels is not None
        for row in range(len(boxes)):
            cos, sin = torch.cos(boxes.yaws[row]), torch.sin(boxes.yaws[row])
            axes = torch.stack([torch.stack([cos, -sin]), torch.stack([sin, cos])])
            apart = sweep.points[:, :3].double() - boxes.centres[row]
            apart[:, :2] = apart[:, :2] @ axes
            inside = (apart.abs() <= boxes.half_sizes[row] + HAND).all(1)
            agreeing += int((sweep.labels[inside] // 1000 == boxes.categories[row]).sum())
            total += int(inside.sum())
    assert total > 3000
    assert agreeing / total > 0.9


def test_every_instance_has_the_box_that_holds_its_points(reader: PanopticNuScenes, tmp_path: Path) -> None:
    """The boxes of an object hold nearly all points of the instance whose modal centres lie in them."""
    table = InstanceTables(reader, Amodal(), tmp_path).table(SCENE)
    assert isinstance(table, BoxedTable)
    assert len(table.track_outlines) > 5
    assert table.boxes.known.all()
    inside = 0
    for number, frame in enumerate(reader.key_frames(SCENE)):
        sweep, rows = reader.sweep(frame), table.rows(number)
        assert sweep.labels is not None
        headings = table.boxes.yaws[rows] - yaw(sweep.pose)
        for row, heading in zip(rows.tolist(), headings, strict=True):
            points = sweep.points[sweep.labels == table.keys[row], :3].double()
            away = along(points - table.boxes.centres[row], heading.expand(len(points)))
            inside += int((away.abs() <= table.boxes.half_sizes[row] + HAND).all(1).sum())
    assert inside / int(table.counts.sum()) > 0.99


def test_a_thing_is_an_instance_through_the_scene(reader: PanopticNuScenes) -> None:
    tokens = [set(reader.boxes(frame).instances) for frame in reader.key_frames(SCENE)]
    assert len(tokens) == 20
    assert len(tokens[0] & tokens[1]) > 5
