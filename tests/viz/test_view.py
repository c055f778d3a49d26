"""Recordings for the viewer, written by the command and read back: what is shown, where and when."""

import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
import torch

from commands import Command, most
from most.datasets.reader import Frame
from most.datasets.semantickitti import SemanticKITTI, SemanticKITTISettings, Splits
from most.errors import ConfigError, DataError
from most.metrics.assignments import Assignments, assignments_path, write_assignments
from most.structures import Detections
from most.view import ViewConfig, view
from most.viz.identities import Identities
from semantickitti_tree import lidar_pose, world_points, write_tree

ENTITIES = ("sensor", "sensor/stuff", "sensor/things", "sensor/tracks", "sensor/boxes", "sensor/velocities")
CAR_ID, PARKED_ID = 5, 9  # of the prediction


def needs_rerun():
    return pytest.importorskip("rerun", reason="recordings take the extra viz")


class Shown:
    """A recording read back: each component's value by entity and scan."""

    def __init__(self, path: Path) -> None:
        self.reader = needs_rerun().chunk.RrdReader(path)
        self.rows: dict = defaultdict(dict)
        self.timelines, self.seconds = set(), {}
        for chunk in self.reader.stream().to_chunks():
            self._add(chunk)

    def _add(self, chunk) -> None:
        table = chunk.to_record_batch().to_pydict()
        if not chunk.is_static:
            self.timelines.add(tuple(sorted(chunk.timeline_names)))
        for row in range(chunk.num_rows):
            scan = None if chunk.is_static else table["scan"][row]
            if scan is not None:
                self.seconds[scan] = table["time"][row].total_seconds()
            values = {name.split(":")[1]: column[row] for name, column in table.items() if ":" in name}
            self.rows[chunk.entity_path].setdefault(scan, {}).update(values)

    def __call__(self, entity: str, scan: int | None) -> dict:
        return self.rows[f"/{entity}"][scan]


def write_labels_only(folder: Path, reader: SemanticKITTI, scans: range, name: str = "08") -> None:
    """Predictions that are right, but for numbers of their own and a car that is another from scan 2 on."""
    for index in scans:
        frame = Frame(name, index)
        labels = torch.from_numpy(world_points(index)[1].astype(np.int64))
        ids = torch.where(labels >> 16 == 7, CAR_ID if index < 2 else 6, torch.where(labels >> 16 == 3, PARKED_ID, 0))
        semantics = reader.taxonomy.to_training(labels)
        semantics[semantics == 0] = reader.taxonomy.class_names.index("road")
        reader.write_prediction(reader.prediction_path(folder, frame), reader.taxonomy.encode(semantics, ids))


def write_detections(folder: Path, reader: SemanticKITTI, index: int, yaws: torch.Tensor | None = None) -> None:
    """One detection of the moving car, which claims its points and one of the other's, and one that claims none."""
    found = Detections(
        torch.tensor([1, 6]), torch.tensor([0.9, 0.3]), torch.tensor([[5.0, 1, 0], [9, 9, 0]]),
        torch.tensor([[2.0, 1, 0.5], [0.5, 0.5, 1]]), torch.tensor([[0.0, 3], [0.1, 0]]), yaws,
    )  # fmt: skip
    claims = torch.full((len(world_points(index)[0]),), -1)
    claims[:5] = 0
    path = assignments_path(reader.prediction_path(folder, Frame("08", index)))
    write_assignments(path, Assignments(found, torch.ones(2, 3), claims))


@pytest.fixture
def tree(tmp_path) -> Path:
    """A tree, and predictions of its validation scans without detections."""
    write_tree(tmp_path / "tree")
    write_labels_only(tmp_path / "predictions", SemanticKITTI(tmp_path / "tree"), range(3))
    return tmp_path


def recorded(folder: Path, **changes) -> Shown:
    needs_rerun()
    dataset = SemanticKITTISettings(root=str(folder / "tree"), splits=Splits())
    settings = {"sequence": "08", "out": str(folder / "new" / "scene.rrd"), "dataset": dataset} | changes
    view(ViewConfig(predictions=str(folder / "predictions"), **settings))
    return Shown(Path(settings["out"]))


def test_both_trees_show_every_point_of_every_scan(tree):
    shown = recorded(tree)
    assert set(shown.rows) >= {f"/{root}/{name}" for root in ("prediction", "truth") for name in ENTITIES}
    assert shown.timelines == {("scan", "time")}
    assert shown.seconds == pytest.approx({0: 0.0, 1: 0.1, 2: 0.2})
    for scan, (cars, parked) in enumerate([(4, 1), (4, 2), (4, 1)]):
        for root in ("prediction", "truth"):
            assert len(shown(f"{root}/sensor/stuff", scan)["positions"]) == 3
            assert len(shown(f"{root}/sensor/things", scan)["positions"]) == cars + parked
            assert len(shown(f"{root}/sensor/tracks", scan)["positions"]) == cars + parked
            assert len(shown(f"{root}/sensor/boxes", scan)["centers"]) == 2
        assert shown("truth/sensor/stuff", scan)["class_ids"] == [9, 9, 0]
        assert shown("prediction/sensor/stuff", scan)["class_ids"] == [9, 9, 9]
        assert shown("truth/sensor/things", scan)["class_ids"] == [1] * (cars + parked)
    assert [one.kind for one in shown.reader.recordings() + shown.reader.blueprints()] == ["recording", "blueprint"]
    assert [path.name for path in (tree / "new").iterdir()] == ["scene.rrd"]


def test_points_moved_by_the_sensors_pose_lie_where_the_world_has_them(tree):
    shown = recorded(tree)
    for scan in range(3):
        where = shown("prediction/sensor", scan)
        (translation,), (columns,) = where["translation"], where["mat3x3"]
        np.testing.assert_allclose(translation, lidar_pose(scan)[:3, 3], atol=1e-5)
        local = np.array(shown("prediction/sensor/things", scan)["positions"])
        world = local @ np.array(columns).reshape(3, 3) + translation  # columns one after the other: transposed
        np.testing.assert_allclose(world, world_points(scan)[0][:-3], atol=1e-5)
        np.testing.assert_allclose(shown("truth/sensor", scan)["mat3x3"], where["mat3x3"])


def test_objects_keep_their_colour_in_both_trees_until_their_identity_is_lost(tree):
    shown = recorded(tree)
    seen = {
        (root, scan): shown(f"{root}/sensor/tracks", scan)["colors"]
        for root in ("prediction", "truth") for scan in range(3)
    }  # fmt: skip
    car, parked = seen["truth", 0][0], seen["truth", 0][4]
    assert car != parked
    for scan in range(3):
        count = len(seen["truth", scan]) - 4
        assert seen["truth", scan] == [car] * 4 + [parked] * count
    assert seen["prediction", 0] == seen["truth", 0]
    assert seen["prediction", 1] == seen["truth", 1]
    lost = seen["prediction", 2][0]
    assert lost not in (car, parked)
    assert seen["prediction", 2] == [lost] * 4 + [parked]
    boxes = shown("prediction/sensor/boxes", 2)
    assert dict(zip(boxes["labels"], boxes["colors"], strict=True)) == {"car 6": lost, "car 9": parked}


def test_boxes_and_arrows_are_those_of_the_instances(tree):
    """The car drives 10 m/s along the world's y; turned by 0.1 a scan, the sensor has y to its left."""
    shown = recorded(tree)
    truth, predicted = shown("truth/sensor/boxes", 0), shown("prediction/sensor/boxes", 0)
    row = truth["labels"].index(f"car {(7 << 16) | 252}")
    np.testing.assert_allclose(truth["centers"][row], [10.75, 2.375, 0.55], atol=1e-5)
    np.testing.assert_allclose(truth["half_sizes"][row], [1.25, 0.625, 0.45], atol=1e-5)
    mine = predicted["labels"].index(f"car {CAR_ID}")
    assert predicted["centers"][mine] == truth["centers"][row]
    assert predicted["half_sizes"][mine] == truth["half_sizes"][row]
    arrows = shown("truth/sensor/velocities", 1)
    np.testing.assert_allclose(np.linalg.norm(arrows["vectors"], axis=1)[0], 10, atol=1e-4)
    np.testing.assert_allclose(arrows["vectors"][0], [10 * np.sin(0.1), 10 * np.cos(0.1), 0], atol=1e-4)
    assert shown("prediction/sensor/velocities", 1)["vectors"] == []  # labels of one scan tell of no motion


def test_detections_beside_the_labels_are_shown_in_the_colours_of_what_they_claim(tree):
    reader = SemanticKITTI(tree / "tree")
    for index in range(3):
        write_detections(tree / "predictions", reader, index)
    shown = recorded(tree)
    boxes, arrows = (shown(f"prediction/sensor/{name}", 1) for name in ("boxes", "velocities"))
    assert boxes["labels"] == [f"car {CAR_ID}", "person"]
    assert boxes["centers"] == [[5, 1, 0], [9, 9, 0]]
    assert boxes["half_sizes"] == [[2, 1, 0.5], [0.5, 0.5, 1]]
    assert boxes["colors"] == [shown("prediction/sensor/tracks", 1)["colors"][0], 0xFFFFFFFF]
    assert arrows["vectors"] == [[0, 3, 0]]  # the other one is as good as still
    assert arrows["origins"] == [[5, 1, 0]]


def test_turned_detections_are_shown_turned(tree):
    reader = SemanticKITTI(tree / "tree")
    for index in range(3):
        write_detections(tree / "predictions", reader, index, torch.tensor([np.pi / 2, 0.0]).float())
    turns = recorded(tree)("prediction/sensor/boxes", 1)["quaternions"]
    np.testing.assert_allclose(turns, [[0, 0, 0.5**0.5, 0.5**0.5], [0, 0, 0, 1]], atol=1e-6)


def test_a_sequence_without_labels_shows_the_prediction_alone(tree):
    write_labels_only(tree / "predictions", SemanticKITTI(tree / "tree"), range(2), "11")
    shown = recorded(tree, sequence="11")
    assert not [path for path in shown.rows if path.startswith("/truth")]
    assert len(shown("prediction/sensor/things", 1)["positions"]) == 6


def test_a_range_of_scans_is_chosen_and_those_without_a_prediction_are_told_of(tree):
    (tree / "predictions" / "sequences" / "08" / "predictions" / "000001.label").unlink()
    with pytest.warns(UserWarning, match="1 of 2 scans have no prediction"):
        shown = recorded(tree, first=1)
    assert shown.seconds == {2: 0.0}


def test_points_that_are_not_finite_are_not_shown(tree):
    path = tree / "tree" / "sequences" / "08" / "velodyne" / "000000.bin"
    points = np.fromfile(path, "<f4").reshape(-1, 4)
    points[[0, 6], 0] = np.nan  # one of the car's, one of the road's
    points.tofile(path)
    shown = recorded(tree)
    assert len(shown("prediction/sensor/things", 0)["positions"]) == 4
    assert len(shown("prediction/sensor/tracks", 0)["colors"]) == 4
    assert len(shown("prediction/sensor/stuff", 0)["positions"]) == 2


def test_nothing_to_show_is_refused(tree):
    with pytest.raises(DataError, match=r"000000\.label: expected predictions of scans 0 to 1, found none of 2"):
        recorded(tree, sequence="11", last=1)
    with pytest.raises(DataError, match=r"sequence 08: expected predictions of scans 7 to the last, found none of 0"):
        recorded(tree, first=7)
    assert not (tree / "new").exists()


def test_labels_that_do_not_fit_are_refused_and_nothing_is_left(tree):
    path = tree / "predictions" / "sequences" / "08" / "predictions" / "000002.label"
    path.write_bytes(path.read_bytes()[:-4])
    with pytest.raises(DataError, match=r"000002\.label: expected a label for each of the scan's 8 points, found 7"):
        recorded(tree)
    assert list((tree / "new").iterdir()) == []


def test_an_older_recording_is_replaced_only_by_a_whole_one(tree):
    out = tree / "scene.rrd"
    out.write_bytes(b"older")
    path = tree / "predictions" / "sequences" / "08" / "predictions" / "000002.label"
    content = path.read_bytes()
    path.write_bytes(content[:-4])
    with pytest.raises(DataError):
        recorded(tree, out=str(out))
    assert out.read_bytes() == b"older"
    path.write_bytes(content)
    assert recorded(tree, out=str(out)).seconds.keys() == {0, 1, 2}


def test_without_rerun_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ConfigError, match=r"pip install 'most-lidar\[viz\]'") as refused:
        view(ViewConfig(predictions="a", sequence="08"))
    assert refused.value.exit_code == 2


@pytest.mark.parametrize("values", [{"first": -1}, {"first": 5, "last": 4}])
def test_ranges_that_are_none_are_refused(values):
    with pytest.raises(ConfigError, match="expected"):
        ViewConfig(**values)


def test_the_command_writes_a_recording(tree):
    needs_rerun()
    done = most(tree, "view", "predictions=predictions", "sequence='08'", "last=0", "out=a.rrd", "dataset.root=tree")
    assert done.returncode == 0, done.stderr
    assert Shown(tree / "a.rrd").seconds == {0: 0.0}


def test_a_recording_that_a_full_disk_cuts_off_is_refused_and_goes(tree):
    needs_rerun()
    arguments = ["predictions=predictions", "sequence='08'", "out=new/a.rrd", "dataset.root=tree"]
    done = Command(tree, "view", *arguments, largest_file=10_000).done()
    assert done.returncode == 2
    assert "expected room for a whole recording, found it cut off" in done.stderr
    assert list((tree / "new").iterdir()) == []


def test_new_identities_take_the_preferred_number_unless_it_is_taken():
    truth, prediction = Identities(1), Identities(-1)
    truth.meet(torch.tensor([70, 0, 80]), {})
    assert truth.numbers == {70: 1, 80: 2}
    prediction.meet(torch.tensor([3, 4, 5]), {3: 2, 5: 2})
    prediction.meet(torch.tensor([3, 6]), {3: 1, 6: 1})
    assert prediction.numbers == {3: 2, 4: -2, 5: -3, 6: 1}
    assert prediction.colours(torch.tensor([0, 3])).tolist() == [
        [255] * 3,
        truth.colours(torch.tensor([80]))[0].tolist(),
    ]
