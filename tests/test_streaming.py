"""A stream says what the batch says, scan by scan, whatever a robot's day brings."""

import io
import math

import numpy as np
import pytest
import torch

from most.assembly import Trained
from most.datasets.reader import Frame
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.datasets.window_stream import WindowStream
from most.detections import PeakDetector
from most.errors import ConfigError, DataError
from most.inference import Inference
from most.predicting import write_predictions
from most.predictions import read_prediction
from most.streaming import PanopticTracker
from most.tracking import TrackerSettings
from semantickitti_tree import TR, lidar_pose
from tiny import TAXONOMY, cloud, tiny_predictor

SCANS = 6
PREVIOUS = 2


def scan(index, count=600):
    """A world of points that stand still, as the sensor of scan ``index`` sees them, with intensities."""
    world = np.concatenate([cloud(count).numpy(), np.full((count, 1), 1.0)], 1)
    seen = world @ np.linalg.inv(lidar_pose(index)).T
    return np.concatenate([seen[:, :3], np.linspace(0, 1, count)[:, None]], 1).astype(np.float32)


def tracker(previous=PREVIOUS, settings=None):
    """A model with random weights that sees trucks, motorcycles and riders, some of which it detects."""
    eager = Inference(PeakDetector(threshold=0.008))
    return PanopticTracker(Trained(tiny_predictor(9, inference=eager), TAXONOMY, previous), settings)


@pytest.fixture
def model():
    return tracker()


@pytest.fixture
def reader(tmp_path):
    folder = tmp_path / "tree/sequences/08"
    (folder / "velodyne").mkdir(parents=True)
    for index in range(SCANS):
        scan(index).tofile(folder / f"velodyne/{index:06d}.bin")
    cameras = [TR @ lidar_pose(index) @ np.linalg.inv(TR) for index in range(SCANS)]
    np.savetxt(folder / "poses.txt", [camera[:3].ravel() for camera in cameras], fmt="%.17g")
    np.savetxt(folder / "times.txt", np.arange(SCANS) * 0.1, fmt="%.17g")
    (folder / "calib.txt").write_text(f"Tr: {' '.join(map(str, TR[:3].ravel()))}\n")
    return SemanticKITTI(tmp_path / "tree", Splits(test=["08"]))


def stream(model, reader, indices=range(SCANS)):
    """What the stream says of the reader's scans."""
    steps = []
    for index in indices:
        sweep = reader.sweep(Frame("08", index))
        steps.append(model.step(sweep.points, sweep.pose, sweep.time))
    return steps


def same(one, other):
    return torch.equal(one.semantics, other.semantics) and torch.equal(one.ids, other.ids)


def test_the_stream_is_the_batch_bit_for_bit(model, reader, tmp_path):
    frames = reader.frames("test")
    write_predictions(model, WindowStream(reader, frames, PREVIOUS), reader, tmp_path / "out", len(frames))
    model.begin()
    numbers, claimed = [], []
    for frame, step in zip(frames, stream(model, reader), strict=True):
        path = reader.prediction_path(tmp_path / "out", frame)
        written = read_prediction(reader, path)
        assert torch.equal(reader.read_prediction(path), TAXONOMY.encode(step.semantics, step.ids))
        assert torch.equal(written.detections.centres, step.prediction.detections.centres)
        assert torch.equal(written.claimed, step.prediction.claimed)
        numbers.append(len(step.ids.unique()))
        claimed.append(int((written.claimed >= 0).sum()))
    assert min(numbers) > 10  # there was something to follow
    assert sum(claimed) > 10


def test_a_run_that_goes_on_writes_what_it_would_have_written(model, reader, tmp_path):
    frames, out = reader.frames("test"), tmp_path / "out"
    write_predictions(model, WindowStream(reader, frames, PREVIOUS), reader, out, len(frames))
    whole = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    for index in (1, 4, 5):
        reader.prediction_path(out, frames[index]).unlink()
    write_predictions(model, WindowStream(reader, frames, PREVIOUS), reader, out, len(frames))
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == whole


def test_what_was_said_before_is_gone_on_from(model, reader):
    whole = stream(model, reader)
    model.begin()
    for index, step in enumerate(whole[:-1]):
        sweep = reader.sweep(Frame("08", index))
        model.recall(step.prediction, sweep.points, sweep.pose, sweep.time)
    assert same(stream(model, reader, [SCANS - 1])[0], whole[-1])


def test_two_streams_with_a_saved_state_are_one(model, reader):
    whole = stream(model, reader)
    model.begin()
    stream(model, reader, range(3))
    file = io.BytesIO()
    torch.save(model.state(), file)
    file.seek(0)
    other = tracker()
    other.restore(torch.load(file, weights_only=True))
    assert all(map(same, stream(other, reader, range(3, SCANS)), whole[3:]))


def test_no_label_depends_on_a_later_scan(model, reader):
    whole = stream(model, reader)
    for end in range(1, SCANS):
        model.begin()
        assert same(stream(model, reader, range(end))[-1], whole[end - 1])


def test_every_point_gets_class_confidence_and_number(model):
    points = scan(0)
    points[3] = math.nan
    points[4, 0] = math.inf
    points[5, :2] = 1e4
    step = model.step(points, np.eye(4), 0.0)
    assert len(step.semantics) == len(step.ids) == len(step.confidence) == len(points)
    assert ((step.semantics > 0) & (step.confidence >= 0) & (step.confidence <= 1)).all()
    assert (step.confidence == 0).nonzero().flatten().tolist() == [3, 4, 5]  # what the network never saw
    thing = TAXONOMY.is_thing(step.semantics)
    assert (step.ids[~thing] == 0).all()
    now = step.tracks.last_seen == 0.0
    somewhere = torch.from_numpy(np.isfinite(points[:, :3]).all(1))
    assert set(step.ids[(step.ids > 0) & somewhere].tolist()) == set(step.tracks.ids[now].tolist())
    assert list(step.seconds) == ["accumulate", "network", "fusion", "tracking"]


def test_scans_without_points_and_without_intensity_are_no_error(model):
    bare = model.step(scan(0)[:, :3].tolist(), np.eye(4), 0.0)
    model.begin()
    dark = np.concatenate([scan(0)[:, :3], np.zeros((600, 1), np.float32)], 1)
    assert same(bare, model.step(dark, torch.eye(4), 0.0))
    assert len(model.step(np.zeros((0, 3)), np.eye(4), 0.1).ids) == 0
    assert len(model.step(scan(2), np.eye(4), 0.2).ids) == 600


def test_without_poses_each_scan_is_seen_by_itself(model):
    with pytest.warns(UserWarning, match="no pose: the sweeps before are left out"):
        steps = [model.step(scan(index)) for index in range(3)]
    single = tracker(previous=0)
    assert all(map(same, steps, [single.step(scan(index)) for index in range(3)]))


def test_what_stands_still_keeps_its_number_when_scans_are_missing():
    model = tracker(0, TrackerSettings(motion="nearest"))
    steps = [model.step(scan(0), np.eye(4), 0.1 * index) for index in (0, 1, 2, 5, 14)]
    assert all(torch.equal(step.ids, steps[0].ids) for step in steps)
    assert not torch.equal(model.step(scan(0), np.eye(4), 3.0).ids, steps[0].ids)  # lost, after a second and a half


def test_after_a_jump_of_the_pose_things_are_new_and_the_stream_goes_on(model):
    far = np.eye(4)
    far[:2, 3] = 1e3
    steps = [model.step(scan(0), pose, 0.1 * index) for index, pose in enumerate([np.eye(4)] * 3 + [far] * 3)]
    assert torch.equal(steps[0].semantics, steps[3].semantics)  # nothing that came before is near
    before, after = (set(step.ids[step.ids > 0].tolist()) for step in (steps[2], steps[3]))
    assert before
    assert not before & after


def test_the_order_of_points_changes_nothing(model):
    shuffled = torch.randperm(600, generator=torch.Generator().manual_seed(3)).numpy()
    plain = [model.step(scan(index), lidar_pose(index), 0.1 * index) for index in range(4)]
    model.begin()
    for index, step in enumerate(plain):
        other = model.step(scan(index)[shuffled], lidar_pose(index), 0.1 * index)
        assert torch.equal(other.semantics, step.semantics[shuffled])
        assert torch.equal(other.ids, step.ids[shuffled])


def test_sweeps_between_those_that_are_asked_about_fill_the_windows(model, reader, tmp_path):
    frames, out = reader.frames("test")[::2], tmp_path / "out"
    write_predictions(model, WindowStream(reader, frames, PREVIOUS), reader, out, len(frames))
    model.begin()
    for index in range(frames[-1].index + 1):
        sweep = reader.sweep(Frame("08", index))
        if index % 2:
            model.accumulate(sweep.points, sweep.pose, sweep.time)
        else:
            step = model.step(sweep.points, sweep.pose, sweep.time)
            written = reader.read_prediction(reader.prediction_path(out, Frame("08", index)))
            assert torch.equal(written, TAXONOMY.encode(step.semantics, step.ids))


def test_any_clock_will_do(model):
    first = model.step(scan(0), lidar_pose(0), 0.0)
    model.begin()
    assert same(model.step(scan(0), lidar_pose(0), -64.0), first)
    assert model.tracker.tracks().last_seen.unique().tolist() == [-64.0]


def test_the_callers_memory_may_be_used_again(model):
    whole = [model.step(scan(index), lidar_pose(index), 0.1 * index) for index in range(4)]
    model.begin()
    points, pose = np.zeros((600, 4), np.float32), np.eye(4)
    for index, step in enumerate(whole):
        points[:], pose[:] = scan(index), lidar_pose(index)
        assert same(model.step(points, pose, 0.1 * index), step)


@pytest.mark.parametrize(
    ("points", "pose", "time", "message"),
    [
        (np.zeros((5, 2)), np.eye(4), 1.0, r"points: expected N x 3 .* found the shape \(5, 2\)"),
        (np.zeros(12), np.eye(4), 1.0, r"points: expected N x 3"),
        (np.zeros(5, [("x", "f4")]), np.eye(4), 1.0, "points: expected an array of numbers, .* makes one of fields"),
        ([[1, 2, 3], [1, 2]], np.eye(4), 1.0, "points: expected one array of numbers, found rows that make none"),
        (np.zeros((5, 3), complex), np.eye(4), 1.0, "points: expected an array of numbers, found complex128"),
        (np.zeros((5, 3)), np.eye(3), 1.0, r"pose: expected world_from_sensor, 4 x 4, found the shape \(3, 3\)"),
        (np.zeros((5, 3)), np.full((4, 4), math.nan), 1.0, "expected a finite pose"),
        (np.zeros((5, 3)), lidar_pose(3).T, 1.0, "pose: expected 0 0 0 1 in the last row"),
        (np.zeros((5, 3)), 2 * np.eye(4), 1.0, "pose: expected a rotation in the first three rows and columns"),
        (scan(1), lidar_pose(1), 0.05, "expected a time after the last sweep's 0.1 s"),
        (scan(1), lidar_pose(1), math.nan, "expected a time after the last sweep's 0.1 s"),
    ],
)
def test_a_scan_that_is_refused_changes_nothing(model, reader, points, pose, time, message):
    whole = stream(model, reader)
    model.begin()
    stream(model, reader, range(2))
    with pytest.raises(DataError, match=message):
        model.step(points, pose, time)
    assert all(map(same, stream(model, reader, range(2, SCANS)), whole[2:]))


def test_memory_does_not_grow_with_the_stream(model):
    sizes = []
    for index in range(80):
        model.step(scan(index, 40), lidar_pose(index), 0.1 * index)
        sizes.append(len(model.tracker.tracks()))
        assert len(model.state()["sweeps"]) <= PREVIOUS
    assert max(sizes[50:]) <= 1.5 * max(sizes[20:50])  # a second and a half after the start all tracks are new


@pytest.mark.parametrize("array", [scan(0).astype(">f4"), scan(0)[::-1][::-1], np.asfortranarray(scan(0), np.float64)])
def test_the_same_points_in_any_array_are_the_same_scan(model, array):
    plain = model.step(scan(0), np.eye(4), 0.0)
    model.begin()
    assert same(model.step(array, np.eye(4).astype(">f8")[::-1][::-1], 0.0), plain)


def test_a_pose_may_be_off_by_rounding(model):
    plain = model.step(scan(0), np.eye(4), 0.0)
    model.begin()
    rounded = np.eye(4)
    rounded[3] = [1e-9, 0, 0, 1 - 1e-9]
    assert same(model.step(scan(0), rounded, 0.0), plain)


def test_raw_intensities_say_what_scaled_ones_say(model, recwarn):
    raw = scan(0)
    raw[:, 3] *= 255
    raw[:9, 3] = [math.nan, math.inf, -1, 256, 1e30, 0, 0, 0, 0]
    clean = raw.copy()
    clean[:, 3] = np.clip(raw[:, 3] / np.float32(255), 0, 1)
    clean[:2, 3] = 0
    scaled = PanopticTracker(Trained(tiny_predictor(9), TAXONOMY, 0), intensity_scale=255.0)
    expected = PanopticTracker(Trained(tiny_predictor(9), TAXONOMY, 0)).step(clean, np.eye(4), 0.0)
    assert not recwarn
    found = [scaled.step(raw, np.eye(4), time) for time in (0.0, 0.1)]
    assert torch.equal(found[0].confidence, expected.confidence)
    assert same(found[0], expected)
    (told,) = recwarn
    assert "points: expected intensities up to intensity_scale=255, found 1e+30" in str(told.message)
    with pytest.raises(ConfigError, match="intensity_scale: expected a number > 0, found 0"):
        PanopticTracker(Trained(tiny_predictor(9), TAXONOMY, 0), intensity_scale=0.0)


@pytest.mark.parametrize("height", [1e4, -1e10, 3e38])
def test_points_at_absurd_heights_spoil_no_others(height):
    points = scan(0)
    points[:300, :3] = [1.0, 1.0, 0.1]  # many points of one voxel; some of them stray
    strayed = np.concatenate([points, [[1.0, 1.0, height, 0.5]] * 3]).astype(np.float32)
    plain = tracker(0).step(points, np.eye(4), 0.0)
    found = tracker(0).step(strayed, np.eye(4), 0.0)
    assert torch.equal(found.semantics[:600], plain.semantics)
    assert torch.equal(found.confidence[:600], plain.confidence)
    assert found.confidence[600:].tolist() == [0, 0, 0]
    assert found.tracks.centres.abs().max() < 1e3


def test_scans_without_a_point_in_range_are_told_of_once(model, recwarn):
    for index in range(3):
        model.step(scan(index) * np.float32([1000, 1000, 1000, 1]) + np.float32([1e4, 0, 0, 0]), np.eye(4), 0.1 * index)
    (told,) = recwarn
    assert "no point of a scan is in range (x, y, z: -8 to 8, -8 to 8, -2 to 2): are these metres" in str(told.message)


def test_times_in_other_units_are_told_of_once(model, recwarn):
    for index in range(3):
        model.step(scan(index), lidar_pose(index), 1_695_123_456_000_000_000 + 100_000_000 * index)
    (told,) = recwarn
    assert "a scan comes 100000000 s after the last: give times in seconds, and call begin()" in str(told.message)


def test_after_a_pause_the_window_begins_anew(model):
    model.step(scan(0), lidar_pose(0), 0.0)
    late = model.step(scan(1), lidar_pose(1), 10.1)
    model.begin()
    assert torch.equal(model.step(scan(1), lidar_pose(1), 0.0).confidence, late.confidence)
    model.begin()
    model.step(scan(0), lidar_pose(0), 0.0)
    assert not torch.equal(model.step(scan(1), lidar_pose(1), 9.9).confidence, late.confidence)


def test_a_sweep_without_a_pose_fills_no_window(model):
    with pytest.warns(UserWarning, match="no pose"):
        model.accumulate(scan(5), None, 0.0)
    found = model.step(scan(1), lidar_pose(1), 0.1)
    model.begin()
    assert torch.equal(model.step(scan(1), lidar_pose(1), 0.0).confidence, found.confidence)


def without_a_row(state):
    state["tracker"]["centres"] = state["tracker"]["centres"][:1]


def of_other_classes(state):
    state["tracker"]["classes"] += 100


def without_points(state):
    state["sweeps"] = [{"x": 1}]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (without_a_row, r"state: centres: expected torch.float64 of shape \(\d+, 3\), found .* \(1, 3\)"),
        (of_other_classes, "tracks: expected classes up to 19"),
        (without_points, "state: expected what state"),
        (dict.clear, "state: expected what state.. of a tracker returned, found another .KeyError: 'tracker'"),
        (lambda state: state.update(previous=1), "one of a model with 2 previous sweeps, found one with 1"),
        (lambda state: state.update(time="late"), "state: expected what state"),
        (lambda state: state["tracker"].update(given=torch.zeros(3)), "state: given: expected torch.int64"),
    ],
)
def test_a_state_that_is_refused_changes_nothing(model, reader, spoil, message):
    whole = stream(model, reader)
    model.begin()
    stream(model, reader, range(3))
    other = tracker()
    stream(other, reader, range(2))
    spoil(state := other.state())
    with pytest.raises(DataError, match=message):
        model.restore(state)
    assert all(map(same, stream(model, reader, range(3, SCANS)), whole[3:]))


def test_a_state_of_another_motion_changes_nothing(model, reader):
    other = tracker(settings=TrackerSettings(motion="kalman"))
    stream(other, reader, range(2))
    before = len(stream(model, reader, range(2))[-1].tracks)
    with pytest.raises(DataError, match="expected the state of a tracker of the same motion"):
        model.restore(other.state())
    assert len(model.tracker.tracks()) == before


def test_a_gpu_that_is_not_there_is_refused_before_the_checkpoint_is_read(monkeypatch, tmp_path):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ConfigError, match="device: expected auto, cpu, or cuda where there is a GPU, found cuda"):
        PanopticTracker.from_checkpoint(tmp_path / "none.ckpt", device="cuda")
    trained = Trained(tiny_predictor(9), TAXONOMY, 0)
    assert PanopticTracker(trained, device="auto").device == torch.device("cpu")
