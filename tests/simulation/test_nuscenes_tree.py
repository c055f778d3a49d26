"""The nuScenes layout: its tables name one another, the real reader reads it, the same seed gives the same bytes."""

import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from most.datasets.nuscenes import NuScenesSettings, PanopticNuScenes, SceneSplits
from most.datasets.nuscenes.files import read_classes
from most.datasets.reader import Frame
from most.errors import ConfigError, DataError
from most.geometry.poses import relative, transform
from most.simulation import SensorSettings, SimulationSettings, TrafficSettings, simulate
from most.simulation.nuscenes_labels import CATEGORIES, MEANT, category
from most.simulation.surfaces import LABELS

VAL, TEST = "scene-0003", "scene-0077"
SENSOR = SensorSettings([-30.67], [10.67], [16], columns=180, max_range=40.0, labelled_range=100.0, height=1.84)
NOISE = 3 * SENSOR.range_noise + 0.05  # m


def settings(*scenes: str, seed: int = 0, scans: int = 14) -> SimulationSettings:
    traffic = TrafficSettings(persons=10, driving=8)
    return SimulationSettings(list(scenes), scans, seed, sensor=SENSOR, traffic=traffic, layout="nuscenes")


def digests(root: Path) -> dict[str, str]:
    files = sorted(path for path in root.rglob("*") if path.is_file())
    return {str(path.relative_to(root)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("tree")
    simulate(settings(VAL, TEST), out)
    return out


@pytest.fixture
def reader(tree: Path) -> PanopticNuScenes:
    return PanopticNuScenes(tree, splits=SceneSplits(val=[VAL]))


def rows(tree: Path, table: str, version: str = "v1.0-trainval") -> list[dict]:
    return json.loads((tree / version / f"{table}.json").read_text())


def test_key_frames_twice_and_sweeps_twenty_times_a_second(reader: PanopticNuScenes) -> None:
    assert reader.frames("val") == [Frame(VAL, 0), Frame(VAL, 10)]
    sweeps = [reader.sweep(frame) for frame in reader.frames_of(VAL)]
    np.testing.assert_allclose([sweep.time for sweep in sweeps], np.arange(14) * 0.05, atol=1e-6)
    assert [sweep.labels is not None for sweep in sweeps] == [index % 10 == 0 for index in range(14)]


def test_a_sweep_belongs_to_the_key_frame_that_follows(tree: Path) -> None:
    samples = {row["token"]: row["timestamp"] for row in rows(tree, "sample")}
    for row in rows(tree, "sample_data"):
        late = row["timestamp"] - max(time for time in samples.values() if time <= row["timestamp"])
        assert row["is_key_frame"] == (late == 0)
        assert 0 <= samples[row["sample_token"]] - row["timestamp"] < 500_000 or late <= 150_000  # behind the last


def test_what_stands_still_stays_where_it_is(reader: PanopticNuScenes) -> None:
    manmade = reader.taxonomy.class_names.index("manmade")
    walls = []
    for frame in reader.frames("val"):
        sweep = reader.sweep(frame)
        world = transform(relative(torch.eye(4, dtype=torch.float64), sweep.pose), sweep.points[:, :3])
        walls.append(world[reader.taxonomy.to_training(sweep.labels) == manmade])
    nearest = torch.cdist(walls[0], walls[1]).min(1).values
    assert nearest.median() < 0.6


def test_points_of_an_instance_lie_in_its_box(reader: PanopticNuScenes) -> None:
    for frame in reader.frames("val"):
        sweep, boxes = reader.sweep(frame), reader.boxes(frame)
        assert sweep.labels is not None
        keys = sweep.labels[reader.taxonomy.instance_of(sweep.labels) > 0].unique()
        assert len(keys) == len(boxes) > 3
        assert sorted((keys // 1000).tolist()) == sorted(boxes.categories.tolist())
        for row in range(len(boxes)):
            cos, sin = torch.cos(boxes.yaws[row]), torch.sin(boxes.yaws[row])
            apart = sweep.points[:, :3].double() - boxes.centres[row]
            apart[:, :2] = apart[:, :2] @ torch.stack([torch.stack([cos, -sin]), torch.stack([sin, cos])])
            inside = (apart.abs() <= boxes.half_sizes[row] + NOISE).all(1)
            counts = torch.stack([(sweep.labels[inside] == key).sum() for key in keys])
            assert counts.max() >= 0.9 * boxes.counts[row]


def test_instances_are_numbered_through_the_scene(tree: Path, reader: PanopticNuScenes) -> None:
    boxes = [reader.boxes(frame) for frame in reader.frames("val")]
    both = set(boxes[0].instances) & set(boxes[1].instances)
    labels = [set(reader.labels(frame).unique().tolist()) for frame in reader.frames("val")]
    shared = {label for label in labels[0] & labels[1] if label % 1000}
    assert len(shared) == len(both) > 2
    counts = {row["token"]: row["nbr_annotations"] for row in rows(tree, "instance")}
    assert all(counts[token] == 2 for token in both)


def test_classes_are_those_of_the_panoptic_labels_and_of_things_without_a_box(
    tree: Path, reader: PanopticNuScenes
) -> None:
    frame = reader.frames("val")[0]
    classes, labels = reader.categories(frame), reader.labels(frame)
    assert torch.equal(classes[labels > 0], labels[labels > 0] // 1000)
    stuff = reader.taxonomy.is_thing(reader.taxonomy.to_training(1000 * classes)).logical_not()
    assert torch.equal(classes[stuff], labels[stuff] // 1000)
    assert all(read_classes(path).max() < 32 for path in (tree / "lidarseg").rglob("*.bin"))


def test_sweeps_have_rings_and_intensities(tree: Path) -> None:
    points = np.fromfile(next((tree / "samples/LIDAR_TOP").iterdir()), "<f4").reshape(-1, 5)
    assert set(np.unique(points[:, 4])) <= set(range(16))
    assert len(np.unique(points[:, 4])) > 8
    assert points[points[:, 4] == 0, 2].max() < 0
    assert 0 <= points[:, 3].min() < 50 < points[:, 3].max() <= 255


def test_test_scenes_are_without_labels_in_their_own_version(tree: Path) -> None:
    reader = PanopticNuScenes(tree, "v1.0-test", SceneSplits(test=[TEST]))
    frames = reader.frames("test")
    assert len(frames) == 2
    assert reader.sweep(frames[0]).labels is None
    assert len(reader.boxes(frames[0])) == 0
    assert not (tree / "v1.0-test/panoptic.json").exists()
    assert {row["name"] for row in rows(tree, "scene")} == {VAL}


def test_tables_name_rows_that_are_there(tree: Path) -> None:
    tables = {path.stem: rows(tree, path.stem) for path in (tree / "v1.0-trainval").iterdir()}
    tokens = {name: {row["token"] for row in content} for name, content in tables.items()}
    assert all(len(tokens[name]) == len(tables[name]) for name in tables)
    for name, content in tables.items():
        for row in content:
            for key, value in row.items():
                table = key.removesuffix("_token").removeprefix("first_").removeprefix("last_")
                table = {"sample": "sample", "annotation": "sample_annotation"}.get(table, table)
                if key.endswith("_token"):
                    assert value in tokens[table], (name, key)
                if key in ("prev", "next") and value:
                    assert value in tokens[name]


def test_same_seed_same_bytes_whatever_the_order_and_another_seed_others(tree: Path, tmp_path: Path) -> None:
    simulate(settings(VAL), tmp_path / "again")
    simulate(settings(TEST, VAL), tmp_path / "again")
    assert digests(tmp_path / "again") == digests(tree)
    simulate(settings(VAL, seed=1, scans=1), tmp_path / "other")
    assert not set(digests(tmp_path / "other").values()) & {
        digest for name, digest in digests(tree).items() if "LIDAR_TOP" in name or "scene.json" in name
    }


def test_what_is_finished_is_kept_and_what_was_interrupted_is_made_anew(tree: Path, tmp_path: Path) -> None:
    simulate(settings(VAL), tmp_path)
    kept = next((tmp_path / "samples/LIDAR_TOP").iterdir())
    before = [path.stat().st_mtime_ns for path in (kept, tmp_path / "v1.0-trainval/category.json")]
    simulate(settings(VAL), tmp_path)
    assert [path.stat().st_mtime_ns for path in (kept, tmp_path / "v1.0-trainval/category.json")] == before
    (tmp_path / f"simulation/{VAL}.json").unlink()  # it is written last: the scene was interrupted
    shutil.rmtree(tmp_path / "v1.0-trainval")
    kept.write_bytes(b"half")
    simulate(settings(VAL, TEST), tmp_path)
    assert digests(tmp_path) == digests(tree)


def test_another_tree_and_other_settings_are_refused(tmp_path: Path) -> None:
    (tmp_path / "v1.0-trainval").mkdir()
    with pytest.raises(DataError, match=r"v1\.0-trainval: expected no tables .* found others; choose another out"):
        simulate(settings(VAL), tmp_path)
    (tmp_path / "simulation").mkdir()


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """A tree of one scene of one scan."""
    simulate(settings(VAL, scans=1), tmp_path / "short")
    return tmp_path / "short"


@pytest.mark.parametrize("scene", [VAL, TEST, "scene-0012"])
def test_scenes_of_another_seed_are_refused_whichever_are_asked_for(short: Path, scene: str) -> None:
    before = digests(short)
    with pytest.raises(DataError, match=rf"simulation/{VAL}\.json: expected the settings asked for now, found others"):
        simulate(settings(scene, seed=1, scans=1), short)
    assert digests(short) == before


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: text[:-9], "expected a scene's record, found none"),
        (lambda text: "7", "expected a scene's made_from and tables, found something else"),
        (lambda text: text.replace('"tables"', '"table"'), "expected a scene's made_from and tables"),
        (lambda text: text.replace('"made_from"', '"made"'), "expected a scene's made_from and tables"),
        (lambda text: text.replace('"sample"', '"samples"'), r"tables\.sample: expected a list of rows"),
    ],
)
def test_damaged_records_are_refused_by_name(short: Path, damage: Callable[[str], str], message: str) -> None:
    record = short / f"simulation/{VAL}.json"
    record.write_text(damage(record.read_text()))
    with pytest.raises(DataError, match=rf"simulation/{VAL}\.json: {message}"):
        simulate(settings(TEST, scans=1), short)
    record.unlink()
    simulate(settings(VAL, scans=1), short)
    assert record.is_file()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"layout": "waymo"}, r"simulation\.layout: expected one of semantickitti, nuscenes, found 'waymo'"),
        ({"layout": "nuscenes"}, r"simulation\.sequences: expected names such as scene-0061 in the layout nuscenes"),
        (
            {"layout": "nuscenes", "sequences": [VAL], "every": 2},
            r"simulation\.every: expected 1 in the layout nuscenes",
        ),
        ({"every": 0}, r"simulation\.every: expected a number in \[1, 100\], found 0"),
        ({"sequences": [VAL]}, r"simulation\.sequences: expected names of two digits.* in the layout semantickitti"),
    ],
)
def test_faulty_settings_are_refused(options: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        SimulationSettings(**options)


def test_every_label_of_the_world_has_a_category() -> None:
    assert set(MEANT) <= set(CATEGORIES)
    assert len(CATEGORIES) == 32
    assert all(category(int(label)) < 32 for label in LABELS)


def test_settings_make_the_reader(tree: Path) -> None:
    reader = NuScenesSettings(root=str(tree)).reader()
    with pytest.warns(UserWarning, match="are not there"):
        assert reader.sequences("val") == [VAL]
