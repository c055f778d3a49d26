"""Rows of nuScenes' tables for a simulated scene, and the tables that all scenes share.

A token is a digest of the seed and of what it names, so that the same settings give the same tables.
"""

import hashlib
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from most.simulation.nuscenes_labels import CATEGORIES, SceneLabels
from most.simulation.world import Scan

KEY_EVERY = 10  # scans from one key frame to the next
START, APART = 1_500_000_000_000_000, 1_000_000_000  # microseconds: when scene-0000 begins, and the next one
AHEAD = 0.94  # m from the car's rear axle to the sensor
TURNED = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # car from sensor: its x is right, its y ahead
VISIBILITIES = ("v0-40", "v40-60", "v60-80", "v80-100")
OF_SCENE = (
    *("log", "calibrated_sensor", "scene", "sample", "sample_data", "ego_pose"),
    *("instance", "sample_annotation", "panoptic", "lidarseg"),
)

Row = dict[str, Any]
Tables = dict[str, list[Row]]


def token(seed: int, *name: object) -> str:
    """32 hexadecimal digits."""
    return hashlib.md5("/".join(map(str, (seed, *name))).encode(), usedforsecurity=False).hexdigest()


def shared_tables(seed: int, scenes: list[str]) -> Tables:
    """The tables that do not belong to one scene."""
    categories = [
        {"token": token(seed, "category", name), "name": name, "description": "", "index": index}
        for index, name in enumerate(CATEGORIES)
    ]
    levels = [{"token": str(n), "level": level, "description": ""} for n, level in enumerate(VISIBILITIES, 1)]
    logs = [token(seed, "log", scene) for scene in scenes]
    files = {"category": "semantic_prior", "filename": "maps/simulated.png"}
    return {
        "category": categories,
        "attribute": [],
        "visibility": levels,
        "sensor": [{"token": token(seed, "sensor"), "channel": "LIDAR_TOP", "modality": "lidar"}],
        "map": [{"token": token(seed, "map"), **files, "log_tokens": logs}],
    }


class SceneRows:
    """The rows of one scene, added in the order of its scans."""

    def __init__(self, seed: int, scene: str, height: float) -> None:
        """``height`` of the sensor above the road, m."""
        self.seed, self.scene = seed, scene
        self.mounted = np.array([AHEAD, 0.0, height])
        self.start = START + APART * int(scene.removeprefix("scene-"))
        self.tables: Tables = {name: [] for name in OF_SCENE}

    def add_sweep(self, index: int, scan: Scan) -> str:
        """Add a scan; returns the name of its file."""
        is_key, own = index % KEY_EVERY == 0, self._token("sweep", index)
        time = self.start + round(scan.time * 1e6)
        folder, log = "samples" if is_key else "sweeps", f"n000-simulated-{self.scene}"
        filename = f"{folder}/LIDAR_TOP/{log}__LIDAR_TOP__{time}.pcd.bin"
        if is_key:
            self.tables["sample"].append({"token": self._token("sample", index // KEY_EVERY), "timestamp": time})
        self.tables["sample_data"].append({
            "token": own, "ego_pose_token": own, "timestamp": time, "filename": filename, "is_key_frame": is_key,
            "calibrated_sensor_token": self._token("mounted"), "fileformat": "pcd", "height": 0, "width": 0,
        })  # fmt: skip
        turn, place = scan.pose[:3, :3], scan.pose[:3, 3]
        car = {"translation": (place - turn @ self.mounted).tolist(), "rotation": quaternion(turn)}
        self.tables["ego_pose"].append({"token": own, "timestamp": time, **car})
        return filename

    def add_labels(self, key_frame: int, version: str) -> tuple[str, str]:
        """Add the label files of a key frame; returns their names: panoptic, classes."""
        own, names = self._token("sweep", key_frame * KEY_EVERY), []
        for kind, suffix in (("panoptic", "npz"), ("lidarseg", "bin")):
            names.append(f"{kind}/{version}/{own}_{kind}.{suffix}")
            self.tables[kind].append({"token": own, "sample_data_token": own, "filename": names[-1]})
        return names[0], names[1]

    def add_boxes(self, labels: SceneLabels) -> None:
        """Add the boxes with points."""
        for instance, number in labels.numbers.items():
            of_thing = [int(row) for row in labels.seen if labels.boxes.instance[row] == instance]
            rows = [self._annotation(labels, number, row) for row in of_thing]
            link(rows)
            self.tables["sample_annotation"] += rows
            kind = CATEGORIES[labels.category_of(of_thing[0])]
            self.tables["instance"].append({
                "token": self._token("instance", number), "category_token": token(self.seed, "category", kind),
                "nbr_annotations": len(rows),
                "first_annotation_token": rows[0]["token"], "last_annotation_token": rows[-1]["token"],
            })  # fmt: skip

    def finished(self) -> Tables:
        """All rows, linked to those before and after; a sweep between key frames belongs to the next of them."""
        samples, sweeps = self.tables["sample"], self.tables["sample_data"]
        for index, row in enumerate(sweeps):
            row["sample_token"] = samples[min(-(-index // KEY_EVERY), len(samples) - 1)]["token"]
        for row in samples:
            row["scene_token"] = self._token("scene")
        link(samples)
        link(sweeps)
        log, mounted = self._token("log"), {"translation": self.mounted.tolist(), "rotation": quaternion(TURNED)}
        self.tables["scene"] = [{
            "token": self._token("scene"), "log_token": log, "nbr_samples": len(samples), "name": self.scene,
            "first_sample_token": samples[0]["token"], "last_sample_token": samples[-1]["token"],
            "description": "simulated street",
        }]  # fmt: skip
        self.tables["log"] = [{
            "token": log, "logfile": f"n000-simulated-{self.scene}", "vehicle": "n000", "date_captured": "2017-07-14",
            "location": "simulated",
        }]  # fmt: skip
        sensor = {"token": self._token("mounted"), "sensor_token": token(self.seed, "sensor"), "camera_intrinsic": []}
        self.tables["calibrated_sensor"] = [sensor | mounted]
        return self.tables

    def _annotation(self, labels: SceneLabels, number: int, row: int) -> Row:
        boxes, key_frame = labels.boxes, int(labels.boxes.scan[row])
        along, across, up = (2 * boxes.half_size[row]).tolist()
        half = float(boxes.yaw[row]) / 2
        return {
            "token": self._token("box", number, key_frame), "sample_token": self._token("sample", key_frame),
            "instance_token": self._token("instance", number), "visibility_token": "4", "attribute_tokens": [],
            "translation": boxes.centre[row].tolist(), "size": [across, along, up],
            "rotation": [float(np.cos(half)), 0.0, 0.0, float(np.sin(half))],
            "num_lidar_pts": int(boxes.points[row]), "num_radar_pts": 0,
        }  # fmt: skip

    def _token(self, kind: str, *name: object) -> str:
        return token(self.seed, kind, self.scene, *name)


def link(rows: list[Row]) -> None:
    """Let each row name those before and after it."""
    names = ["", *(row["token"] for row in rows), ""]
    for index, row in enumerate(rows):
        row |= {"prev": names[index], "next": names[index + 2]}


def quaternion(rotation: np.ndarray) -> list[float]:
    """w, x, y, z of a rotation matrix, w >= 0."""
    x, y, z, w = Rotation.from_matrix(rotation).as_quat(canonical=True).tolist()
    return [w, x, y, z]
