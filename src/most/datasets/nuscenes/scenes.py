"""The scenes of one nuScenes version: which lidar sweeps each has, in which order, and where the sensor was.

``sample_data`` rows of LIDAR_TOP are the sweeps; a sample has one of them as its key frame, and the sweeps between two
key frames name one of them, too. The sensor's pose is that of the car (``ego_pose``) times that on it
(``calibrated_sensor``).
"""

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

from jaxtyping import Float64
from torch import Tensor

from most.datasets.nuscenes.rigid import rigid
from most.datasets.nuscenes.tables import Row, Table
from most.errors import DataError

LIDAR = "LIDAR_TOP"
_SWEEP: dict[str, type] = {
    "sample_token": str,
    "ego_pose_token": str,
    "calibrated_sensor_token": str,
    "timestamp": int,
    "is_key_frame": bool,
    "filename": str,
    "prev": str,
    "next": str,
}
_POSE: dict[str, type] = {"translation": list, "rotation": list}


@dataclass(frozen=True)
class LidarSweep:
    """One row of sample_data."""

    token: str
    sample: str  # token of the sample it belongs to
    filename: str  # relative to the root
    time: float  # s since the scene's first sweep
    is_key: bool


class Scenes:
    """The lidar sweeps of all scenes of a version; tables are read when first needed."""

    def __init__(self, folder: Path) -> None:
        """``folder`` holds the version's tables."""
        self.folder = folder

    @cached_property
    def sweeps(self) -> dict[str, list[LidarSweep]]:
        """The sweeps of each scene, by time; a DataError where tables, tokens or dates do not fit together."""
        rows: dict[str, list[Row]] = {row["name"]: [] for row in self._scenes.rows.values()}
        for token, row in self._sample_data.rows.items():
            sample = self._samples.row(row["sample_token"], self._sample_data.path, token)
            scene = self._scenes.row(sample["scene_token"], self._samples.path, sample["token"])
            rows[scene["name"]].append(row)
        self._check_key_frames()
        return {name: self._in_order(of_scene) for name, of_scene in rows.items()}

    def poses(self, scene: str) -> Float64[Tensor, "sweeps 4 4"]:
        """World_from_sensor of a scene's sweeps."""
        rows, asker = [self._sample_data.rows[sweep.token] for sweep in self.sweeps[scene]], self._sample_data.path
        ego = [self._ego_poses.row(row["ego_pose_token"], asker, row["token"]) for row in rows]
        mounted = [self._calibrated_sensors.row(row["calibrated_sensor_token"], asker, row["token"]) for row in rows]
        return rigid(ego, self._ego_poses.path) @ rigid(mounted, self._calibrated_sensors.path)

    def check_sample(self, token: str, asker: Path, asking: str) -> None:
        """Raise a DataError unless there is a sample ``token``, which the row ``asking`` of a table names."""
        self._samples.row(token, asker, asking)

    def check_sweep(self, token: str, asker: Path, asking: str) -> None:
        """Raise a DataError unless the lidar has a sweep ``token``, which the row ``asking`` of a table names."""
        self._sample_data.row(token, asker, asking)

    @cached_property
    def _scenes(self) -> Table:
        return Table(self.folder / "scene.json", {"name": str}, unique=("name",))

    @cached_property
    def _samples(self) -> Table:
        return Table(self.folder / "sample.json", {"scene_token": str})

    @cached_property
    def _sensors(self) -> Table:
        return Table(self.folder / "sensor.json", {"channel": str})

    @cached_property
    def _calibrated_sensors(self) -> Table:
        return Table(self.folder / "calibrated_sensor.json", {"sensor_token": str, **_POSE})

    @cached_property
    def _sample_data(self) -> Table:
        """The rows of the lidar alone."""
        path, mounted = self.folder / "sample_data.json", self._calibrated_sensors
        tokens = [token for token, row in mounted.rows.items() if self._is_lidar(row)]
        lidars, others = set(tokens), set(mounted.rows) - set(tokens)
        table = Table(path, _SWEEP, lambda row: row.get("calibrated_sensor_token") not in others, unique=("filename",))
        for token, row in table.rows.items():
            if row["calibrated_sensor_token"] not in lidars:
                mounted.row(row["calibrated_sensor_token"], path, token)
        return table

    @cached_property
    def _ego_poses(self) -> Table:
        wanted = {row["ego_pose_token"] for row in self._sample_data.rows.values()}
        return Table(self.folder / "ego_pose.json", _POSE, lambda row: row.get("token") in wanted)

    def _is_lidar(self, mounted: Row) -> bool:
        sensor = self._sensors.row(mounted["sensor_token"], self._calibrated_sensors.path, mounted["token"])
        return bool(sensor["channel"] == LIDAR)

    def _check_key_frames(self) -> None:
        """Raise a DataError unless each sample has one key frame."""
        keys = Counter(row["sample_token"] for row in self._sample_data.rows.values() if row["is_key_frame"])
        for token in self._samples.rows:
            if keys[token] != 1:
                raise DataError(
                    f"{self._sample_data.path}: expected one key frame of {LIDAR} for row {token!r} of sample.json, "
                    f"found {keys[token]}; copy the tables again"
                )

    def _in_order(self, rows: list[Row]) -> list[LidarSweep]:
        rows = sorted(rows, key=lambda row: row["timestamp"])
        path = self._sample_data.path
        for earlier, later in pairwise(rows):
            if earlier["timestamp"] == later["timestamp"]:
                raise DataError(
                    f"{path}: expected a time of its own for each sweep of a scene, "
                    f"found {later['timestamp']} in rows {earlier['token']!r} and {later['token']!r}"
                )
        for row in rows:
            self._check_neighbours(row)
        start = rows[0]["timestamp"] if rows else 0
        return [
            LidarSweep(
                row["token"],
                row["sample_token"],
                row["filename"],
                (row["timestamp"] - start) * 1e-6,
                row["is_key_frame"],
            )
            for row in rows
        ]

    def _check_neighbours(self, row: Row) -> None:
        """Raise a DataError unless the rows before and after are there, and are before and after."""
        table = self._sample_data
        for key, sign in (("prev", -1), ("next", 1)):
            if not row[key]:
                continue
            other = table.row(row[key], table.path, row["token"])
            if sign * (other["timestamp"] - row["timestamp"]) <= 0:
                raise DataError(
                    f"{table.path}: row {row['token']!r}: {key}: expected a sweep "
                    f"{'before' if sign < 0 else 'after'} {row['timestamp']}, found {other['timestamp']}"
                )
