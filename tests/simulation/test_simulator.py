import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from most.datasets.semantickitti import SemanticKITTI, Splits
from most.errors import DataError
from most.simulation import SensorSettings, SimulationSettings, TrafficSettings, simulate
from most.simulation.boxes import Boxes


def _settings(sequences=("00",), seed=0, scans=2) -> SimulationSettings:
    sensor = SensorSettings(fan_lowest=[-20.0], fan_highest=[2.0], fan_beams=[16], columns=128, max_range=30.0)
    return SimulationSettings(list(sequences), scans, seed, sensor=sensor, traffic=TrafficSettings(persons=15))


def _digests(root: Path) -> dict[str, str]:
    files = sorted(path for path in root.rglob("*") if path.is_file())
    return {str(path.relative_to(root)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.fixture(scope="module")
def tree(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("tree")
    simulate(_settings(["00", "08"]), out)
    return out


def test_same_seed_same_bytes_and_another_seed_others(tree, tmp_path):
    simulate(_settings(["08"]), tmp_path / "again")  # alone, so with another history of the process
    again = _digests(tmp_path / "again")
    assert again.items() <= _digests(tree).items()
    simulate(_settings(["08"], seed=1), tmp_path / "other")
    other = _digests(tmp_path / "other")
    scans = [name for name in again if name.endswith((".bin", ".label"))]
    assert all(again[name] != other[name] for name in scans)


def test_sequences_differ(tree):
    a, b = ((tree / "sequences" / name / "velodyne" / "000000.bin").read_bytes() for name in ("00", "08"))
    assert a != b


def test_files_of_a_scan_fit_together(tree):
    folder = tree / "sequences" / "00"
    for index in range(2):
        points = np.fromfile(folder / "velodyne" / f"{index:06d}.bin", np.float32).reshape(-1, 4)
        labels = np.fromfile(folder / "labels" / f"{index:06d}.label", np.uint32)
        assert len(points) == len(labels) > 500
        assert np.isfinite(points).all()
    assert len((folder / "poses.txt").read_text().splitlines()) == 2
    assert [float(line) for line in (folder / "times.txt").read_text().split()] == [0.0, 0.1]


def test_of_several_revolutions_one_can_be_written(tree, tmp_path):
    told = _settings()
    told.every = 10
    simulate(told, tmp_path)

    def drive(root: Path) -> tuple[float, float]:
        folder = root / "sequences" / "00"
        poses = np.loadtxt(folder / "poses.txt").reshape(2, 3, 4)
        return float(np.loadtxt(folder / "times.txt")[1]), float(np.linalg.norm(poses[1, :, 3] - poses[0, :, 3]))

    (time, way), (longer_time, longer_way) = drive(tree), drive(tmp_path)
    assert (time, longer_time) == pytest.approx((0.1, 1.0))
    assert longer_way == pytest.approx(10 * way, rel=0.01)


def test_boxes_load_without_pickle_and_count_the_points(tree):
    folder = tree / "sequences" / "00"
    with np.load(folder / "boxes.npz", allow_pickle=False) as file:
        truth = Boxes(**file)
    labels = np.fromfile(folder / "labels" / "000001.label", np.uint32)
    rows = np.flatnonzero(truth.scan == 1)
    assert len(rows)
    for row in rows:
        assert (labels == truth.instance[row] << 16 | truth.label[row]).sum() == truth.points[row]


def test_the_real_reader_reads_it(tree):
    reader = SemanticKITTI(tree, Splits(train=["00"], val=["08"], test=[]))
    sweep = reader.sweep(reader.frames("val")[1])
    path = tree / "sequences" / "08" / "velodyne" / "000001.bin"
    assert np.array_equal(sweep.points.numpy(), np.fromfile(path, np.float32).reshape(-1, 4))
    assert sweep.time == pytest.approx(0.1)
    assert sweep.labels is not None
    with np.load(tree / "sequences" / "08" / "boxes.npz") as file:
        truth = Boxes(**file)
    row = np.flatnonzero((truth.scan == 1) & (truth.points > 10))[0]
    own = (sweep.labels == int(truth.instance[row] << 16 | truth.label[row])).numpy()
    world = sweep.points.numpy()[own, :3] @ sweep.pose.numpy()[:3, :3].T + sweep.pose.numpy()[:3, 3]
    assert np.linalg.norm(world - truth.centre[row], axis=1).max() < np.linalg.norm(truth.half_size[row]) + 0.2


def test_what_is_finished_is_kept_and_what_was_interrupted_is_made_anew(tree, tmp_path):
    settings = _settings(["00"])
    simulate(settings, tmp_path)
    kept = tmp_path / "sequences" / "00" / "velodyne" / "000000.bin"
    before = kept.stat().st_mtime_ns
    part = tmp_path / "sequences" / ".08.part" / "velodyne"
    part.mkdir(parents=True)
    (part / "000000.bin").write_bytes(b"half")
    simulate(_settings(["00", "08"]), tmp_path)
    assert kept.stat().st_mtime_ns == before
    assert _digests(tmp_path) == _digests(tree)


def test_a_folder_with_something_else_is_refused(tmp_path):
    (tmp_path / "sequences" / "00").mkdir(parents=True)
    with pytest.raises(DataError, match=r"sequences/00: expected .* found other files; choose another out"):
        simulate(_settings(), tmp_path)
    (tmp_path / "sequences" / "00" / "simulation.json").write_text(json.dumps({"seed": 9}))
    with pytest.raises(DataError, match="remove the folder or choose another out"):
        simulate(_settings(), tmp_path)
