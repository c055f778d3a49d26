"""A tiny SemanticKITTI tree whose every number is known."""

from pathlib import Path

import numpy as np

CAR, PARKED, ROAD, UNLABELLED = (7 << 16) | 252, (3 << 16) | 10, 40, 0
# camera_from_lidar: the camera looks along the lidar's x, its x is right, its y down; it sits 0.5 m ahead.
TR = np.array([[0, -1, 0, 0.0], [0, 0, -1, 0.0], [1, 0, 0, -0.5], [0, 0, 0, 1]])
TREE_STEP = 2.0  # m that the sensor drives between two scans, along its x in scan 0
TREE_TURN = 0.1  # radians to the left that it turns between two scans


def lidar_pose(index: int) -> np.ndarray:
    """world_from_sensor of scan ``index``: on the world's x axis, turned left."""
    angle = TREE_TURN * index
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    pose[0, 3] = TREE_STEP * index
    return pose


def world_points(index: int) -> tuple[np.ndarray, np.ndarray]:
    """Points in the world and labels: a car that drives 1 m a scan along y, a parked one, and some road."""
    car = np.array([[10, 2, 0.5], [12, 2, 0.5], [10, 3, 1.0], [11, 2.5, 0.2]]) + np.array([0, 1.0 * index, 0])
    parked = np.array([[4, -4, 0.1], [4.5, -6, 0.4]])[: 1 + (index % 2)]  # its second point is hidden now and then
    road = np.array([[1, 0, -1.7], [2, 0, -1.7], [3, 1, -1.7]])
    labels = [CAR] * len(car) + [PARKED] * len(parked) + [ROAD, ROAD, UNLABELLED]
    return np.concatenate([car, parked, road]), np.array(labels, np.uint32)


def write_sequence(root: Path, name: str, scans: range, labelled: bool = True, rows: int | None = None) -> Path:
    """Write a sequence as the official tree has it; the text files have ``rows`` rows (more than scans by default)."""
    folder = root / "sequences" / name
    (folder / "velodyne").mkdir(parents=True)
    for index in scans:
        points, labels = world_points(index)
        pose = lidar_pose(index)
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        remission = np.linspace(0, 1, len(points))[:, None]
        np.hstack([local, remission]).astype("<f4").tofile(folder / "velodyne" / f"{index:06d}.bin")
        if labelled:
            (folder / "labels").mkdir(exist_ok=True)
            labels.astype("<u4").tofile(folder / "labels" / f"{index:06d}.label")
    rows = scans.stop + 3 if rows is None else rows
    cameras = [TR @ lidar_pose(row) @ np.linalg.inv(TR) for row in range(rows)]
    np.savetxt(folder / "poses.txt", [camera[:3].ravel() for camera in cameras], fmt="%.17g")
    np.savetxt(folder / "times.txt", np.arange(rows) * 0.1, fmt="%.17g")
    (folder / "calib.txt").write_text(f"P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: {' '.join(map(str, TR[:3].ravel()))}\n")
    return folder


def write_tree(root: Path) -> Path:
    """Write training 00 (scans 0..3), validation 08 (0..2) and test 11 (0..1, no labels)."""
    write_sequence(root, "00", range(4))
    write_sequence(root, "08", range(3))
    write_sequence(root, "11", range(2), labelled=False)
    return root
