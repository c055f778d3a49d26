"""A tiny nuScenes tree whose every number is known: a key frame, a sweep between, a key frame, and so on."""

import json
from pathlib import Path
from typing import Any

import numpy as np

CAR, CHILD, ADULT, ROAD, NOISE = 17003, 3001, 2002, 24000, 0
STEP = 2.0  # m that the car drives between two sweeps, along the world's x
PERIOD = 250_000  # microseconds between two sweeps
START = 1_600_000_000_000_000
QUARTER = float(np.sqrt(0.5))
# The sensor sits 1 m ahead and 2 m up on the car; its x points to the right, its y ahead: turned by -90 degrees.
MOUNTED = {"translation": [1.0, 0.0, 2.0], "rotation": [QUARTER, 0.0, 0.0, -QUARTER]}
CATEGORIES = {
    0: "noise",
    2: "human.pedestrian.adult",
    3: "human.pedestrian.child",
    17: "vehicle.car",
    24: "flat.driveable_surface",
}

Tables = dict[str, list[dict[str, Any]]]


def ego_pose(index: int) -> dict[str, list[float]]:
    """The car stands on the world's x axis; at every odd sweep it is turned left by 90 degrees."""
    rotation = [QUARTER, 0.0, 0.0, QUARTER] if index % 2 else [1.0, 0.0, 0.0, 0.0]
    return {"translation": [STEP * index, 0.0, 0.0], "rotation": rotation}


def lidar_pose(index: int) -> np.ndarray:
    """world_from_sensor, worked out by hand."""
    if index % 2:  # the car looks along the world's y, so the sensor's x along the world's x
        return np.array([[1, 0, 0, STEP * index], [0, 1, 0, 1.0], [0, 0, 1, 2], [0, 0, 0, 1]])
    return np.array([[0, 1, 0, STEP * index + 1], [-1, 0, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]])


def world_points(index: int) -> tuple[np.ndarray, np.ndarray]:
    """Points in the world and panoptic labels: a car that drives 1 m a sweep along y, two persons, road, and noise."""
    car = np.array([[10, 2, 0.5], [14, 2, 0.5], [12, 4, 1.5]]) + np.array([0, 1.0 * index, 0])
    persons = np.array([[4, -4, 1], [4, -6, 1]])
    rest = np.array([[1, 0, 0], [2, 0, 0], [3, 1, 5]])
    return np.concatenate([car, persons, rest]), np.array([CAR] * 3 + [CHILD, ADULT, ROAD, ROAD, NOISE], np.uint16)


def tables(scenes: dict[str, bool], sweeps: int = 5) -> Tables:
    """The tables of scenes, which are labelled or not; tokens are plain names."""
    rows: Tables = {
        "sensor": [{"token": "lidar", "channel": "LIDAR_TOP"}, {"token": "camera", "channel": "CAM_FRONT"}],
        "calibrated_sensor": [
            {"token": "lidar-mounted", "sensor_token": "lidar", **MOUNTED},
            {"token": "camera-mounted", "sensor_token": "camera", **MOUNTED},
        ],
        "category": [
            {"token": f"category-{index}", "name": name, "index": index} for index, name in CATEGORIES.items()
        ],
        **{name: [] for name in ("scene", "sample", "sample_data", "ego_pose", "panoptic", "lidarseg")},
        **{name: [] for name in ("instance", "sample_annotation")},
    }
    for name, labelled in scenes.items():
        _add_scene(rows, name, labelled, sweeps)
    return rows


def _add_scene(rows: Tables, name: str, labelled: bool, sweeps: int) -> None:
    rows["scene"].append({"token": f"token-{name}", "name": name})
    rows["instance"].append({"token": f"{name}-car", "category_token": "category-17"})
    for index in range(sweeps):
        sample, token, is_key = f"{name}-sample-{(index + 1) // 2}", f"{name}-{index}", index % 2 == 0
        if is_key:
            rows["sample"].append({"token": sample, "scene_token": f"token-{name}"})
        rows["ego_pose"].append({"token": f"ego-{token}", **ego_pose(index)})
        row = {
            "token": token, "sample_token": sample, "ego_pose_token": f"ego-{token}",
            "timestamp": START + PERIOD * index, "calibrated_sensor_token": "lidar-mounted", "is_key_frame": is_key,
            "filename": f"{'samples' if is_key else 'sweeps'}/LIDAR_TOP/{token}.pcd.bin",
            "prev": f"{name}-{index - 1}" if index else "", "next": f"{name}-{index + 1}" if index < sweeps - 1 else "",
        }  # fmt: skip
        camera = {"token": f"camera-{token}", "calibrated_sensor_token": "camera-mounted", "filename": "a.jpg"}
        rows["sample_data"] += [row, row | camera]
        if is_key and labelled:
            _add_labels(rows, name, sample, token, index)


def _add_labels(rows: Tables, name: str, sample: str, token: str, index: int) -> None:
    for kind, suffix in (("panoptic", "panoptic.npz"), ("lidarseg", "lidarseg.bin")):
        filename = f"{kind}/v1.0-trainval/{token}_{suffix}"
        rows[kind].append({"token": token, "sample_data_token": token, "filename": filename})
    rows["sample_annotation"].append({
        "token": f"box-{token}", "sample_token": sample, "instance_token": f"{name}-car", "num_lidar_pts": 3,
        "translation": [12.0, 3.0 + index, 1.0], "size": [2.0, 4.0, 1.0], "rotation": [1.0, 0.0, 0.0, 0.0],
    })  # fmt: skip


def write_tables(root: Path, rows: Tables, version: str = "v1.0-trainval") -> None:
    """Write each table as its JSON file."""
    (root / version).mkdir(parents=True, exist_ok=True)
    for name, content in rows.items():
        (root / version / f"{name}.json").write_text(json.dumps(content))


def write_tree(root: Path, scenes: dict[str, bool], sweeps: int = 5, version: str = "v1.0-trainval") -> Path:
    """Write scenes, labelled or not, as the official tree has them."""
    rows = tables(scenes, sweeps)
    write_tables(root, rows, version)
    for row in rows["sample_data"]:
        if row["calibrated_sensor_token"] == "lidar-mounted":
            _write_sweep(root, row["filename"], int(row["token"].rsplit("-", 1)[1]))
    for row in rows["panoptic"]:
        labels = world_points(int(row["token"].rsplit("-", 1)[1]))[1]
        (root / row["filename"]).parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(root / row["filename"], data=labels)
        classes = root / row["filename"].replace("panoptic.npz", "lidarseg.bin").replace("panoptic", "lidarseg")
        classes.parent.mkdir(parents=True, exist_ok=True)
        (labels // 1000).astype(np.uint8).tofile(classes)
    return root


def _write_sweep(root: Path, filename: str, index: int) -> None:
    points, pose = world_points(index)[0], lidar_pose(index)
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    intensity, ring = np.linspace(0, 255, len(points)), np.arange(len(points)) % 32
    (root / filename).parent.mkdir(parents=True, exist_ok=True)
    np.column_stack([local, intensity, ring]).astype("<f4").tofile(root / filename)
