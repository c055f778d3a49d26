"""Simulated scenes as a nuScenes tree: key frames twice a second, sweeps twenty times, tables, boxes, labels.

Scenes of the official test split go to ``v1.0-test``, without labels and boxes; all others to ``v1.0-trainval``.
``OUT/simulation/SCENE.json`` keeps a scene's rows of the tables, and what it was made from.
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from most.datasets.nuscenes import official_scenes
from most.datasets.nuscenes.files import write_panoptic
from most.errors import DataError
from most.files import atomic_write
from most.simulation.boxes import boxes
from most.simulation.nuscenes_labels import SceneLabels, categories
from most.simulation.nuscenes_rows import KEY_EVERY, OF_SCENE, SceneRows, Tables, shared_tables
from most.simulation.sensor import elevations
from most.simulation.settings import SensorSettings
from most.simulation.world import Scan, World

FULL, TEST = "v1.0-trainval", "v1.0-test"
ANEW = "remove the file, and the scene is made anew"
UNLABELLED = ("panoptic", "lidarseg")  # tables that the test version does not have
_MAP = bytes.fromhex(  # a grey PNG of one pixel
    "89504e470d0a1a0a0000000d49484452000000010000000108000000003a7e9b55"
    "0000000a49444154789c636800000082008177cd72b60000000049454e44ae426082"
)


class NuScenesTree:
    """A tree of scenes made from the same settings; a scene with a record in ``simulation/`` is complete."""

    def __init__(self, root: Path, made_from: str) -> None:
        """``made_from`` says in JSON what the scenes are made from."""
        self.root, self.made_from = root, json.loads(made_from)
        self._tables: dict[str, Tables] = {}  # of the scenes whose records were read

    def has(self, sequence: str) -> bool:
        """Whether the scene is finished; a DataError where the tree, or any scene of it, is another one."""
        if not (self.root / "simulation").is_dir():
            for version in (FULL, TEST):
                if (self.root / version).exists():
                    raise DataError(
                        f"{self.root / version}: expected no tables or those of simulated scenes, found others; "
                        "choose another out"
                    )
        return sequence in {scene for scene in self._scenes() if self._read(scene)}

    def write(self, sequence: str, world: World, scans: Iterable[Scan]) -> None:
        """Write the scene's sweeps, then its labels, then its record."""
        rows = SceneRows(world.settings.seed, sequence, world.settings.sensor.height)
        keys = []
        for index, scan in enumerate(scans):
            path = self.root / rows.add_sweep(index, scan)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(sweep_points(scan, world.settings.sensor).tobytes())
            keys += [scan] if index % KEY_EVERY == 0 else []
        if version_of(sequence) == FULL:
            labels = SceneLabels(boxes(world, keys))
            rows.add_boxes(labels)
            for number, scan in enumerate(keys):
                panoptic, classes = (self.root / name for name in rows.add_labels(number, FULL))
                write_panoptic(panoptic, torch.from_numpy(labels.panoptic(scan.labels, number).astype(np.int64)))
                _write_changed(classes, categories(scan.labels).tobytes())
        record = {"made_from": self.made_from, "tables": rows.finished()}
        with atomic_write(self._record(sequence), "w") as file:
            json.dump(record, file, indent=1)

    def finish(self) -> None:
        """Write the tables, joined from all scenes that are there; those that would stay the same stay untouched."""
        for version in (FULL, TEST):
            scenes = [scene for scene in self._scenes() if version_of(scene) == version]
            parts = [self._read(scene) for scene in scenes]
            tables = shared_tables(self.made_from["seed"], scenes) if scenes else {}
            for name in parts[0] if parts else ():
                tables[name] = [row for part in parts for row in part[name]]
            for name, rows in tables.items():
                if version == FULL or name not in UNLABELLED:
                    _write_changed(self.root / version / f"{name}.json", json.dumps(rows, indent=1).encode())
        _write_changed(self.root / "maps" / "simulated.png", _MAP)

    def _record(self, scene: str) -> Path:
        return self.root / "simulation" / f"{scene}.json"

    def _scenes(self) -> list[str]:
        """The scenes with a record."""
        return sorted(path.stem for path in (self.root / "simulation").glob("scene-*.json"))

    def _read(self, scene: str) -> Tables:
        """A finished scene's rows; a DataError for a record of other settings, or a damaged one."""
        if scene not in self._tables:
            path = self._record(scene)
            record = read_record(path)
            if record["made_from"] != self.made_from:
                raise DataError(
                    f"{path}: expected the settings asked for now, found others; remove {self.root} or choose another "
                    "out: the scenes of a tree share tables"
                )
            self._tables[scene] = record["tables"]
        return self._tables[scene]


def read_record(path: Path) -> dict[str, Any]:
    """What a scene was made from, and its rows; a DataError where the file does not hold them."""
    try:
        record = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(f"{path}: expected a scene's record, found none ({error}); {ANEW}") from error
    tables = record.get("tables") if isinstance(record, dict) else None
    if not isinstance(tables, dict) or "made_from" not in record:
        raise DataError(f"{path}: expected a scene's made_from and tables, found something else; {ANEW}")
    for name in OF_SCENE:
        if not isinstance(tables.get(name), list) or not all(isinstance(row, dict) for row in tables[name]):
            raise DataError(f"{path}: tables.{name}: expected a list of rows, found something else; {ANEW}")
    return record


def version_of(scene: str) -> str:
    """Which version's tables name the scene."""
    return TEST if scene in official_scenes(TEST, "test") else FULL


def sweep_points(scan: Scan, sensor: SensorSettings) -> Float[np.ndarray, "points 5"]:
    """float32 x (right), y (ahead), z (m), intensity (0 to 255), and the number of the beam, 0 for the lowest."""
    x, y, z, intensity = scan.points.T
    beams = elevations(sensor)[::-1]
    ring = np.searchsorted((beams[1:] + beams[:-1]) / 2, np.arctan2(z, np.hypot(x, y)))
    return np.stack([-y, x, z, np.round(255 * intensity), ring], 1).astype(np.float32)


def _write_changed(path: Path, content: bytes) -> None:
    if not path.is_file() or path.read_bytes() != content:
        with atomic_write(path) as file:
            file.write(content)
