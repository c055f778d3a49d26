"""The boxes of simulated trees, as training reads them, hold the points of their instances."""

from collections.abc import Callable
from pathlib import Path

import pytest

from most.datasets.instances import InstanceTables
from most.datasets.nuscenes import PanopticNuScenes, SceneSplits
from most.datasets.reader import Reader
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.geometry.boxes import along
from most.geometry.poses import yaw
from most.modal.amodal import Amodal
from most.modal.boxes import BoxedTable
from most.simulation import SensorSettings, SimulationSettings, TrafficSettings, simulate

SENSOR = SensorSettings([-24.8], [2.0], [24], columns=180)
TRAFFIC = TrafficSettings(persons=20, driving=8)
NOISE = 3 * SENSOR.range_noise + 0.05  # m
LAYOUTS: dict[str, tuple[str, int, Callable[[Path], Reader]]] = {
    "semantickitti": ("00", 2, lambda root: SemanticKITTI(root, Splits(train=["00"]))),
    "nuscenes": ("scene-0001", 11, lambda root: PanopticNuScenes(root, splits=SceneSplits(train=["scene-0001"]))),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_nearly_every_instance_has_a_box_and_nearly_all_of_its_points_lie_in_it(tmp_path: Path, layout: str) -> None:
    """A thing whose middle is out of range has none; lidar ranges are noisy."""
    sequence, scans, make = LAYOUTS[layout]
    simulate(SimulationSettings([sequence], scans, 0, sensor=SENSOR, traffic=TRAFFIC, layout=layout), tmp_path / "tree")
    reader = make(tmp_path / "tree")
    table = InstanceTables(reader, Amodal(), tmp_path / "tables").table(sequence)
    assert isinstance(table, BoxedTable)
    assert len(table) > 10
    assert table.boxes.known.double().mean() > 0.98
    inside = total = 0
    for number, frame in enumerate(reader.key_frames(sequence)):
        sweep, rows = reader.sweep(frame), table.rows(number)
        assert sweep.labels is not None
        for row in rows[table.boxes.known[rows]].tolist():
            points = sweep.points[sweep.labels == table.keys[row], :3].double()
            heading = table.boxes.yaws[row] - yaw(sweep.pose)
            away = along(points - table.boxes.centres[row], heading.expand(len(points)))
            inside += int((away.abs() <= table.boxes.half_sizes[row] + NOISE).all(1).sum())
            total += len(points)
    assert inside / total > 0.99
