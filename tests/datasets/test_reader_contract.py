"""What every reader promises (most.datasets.reader), over all readers: a new one joins READERS, and has to pass."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
import torch

import nuscenes_tree
import semantickitti_tree
from most.datasets.nuscenes import PanopticNuScenes, SceneSplits
from most.datasets.reader import SPLITS, Frame, Reader
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.errors import ConfigError, DataError

READERS: dict[str, Callable[[Path], Reader]] = {
    "semantickitti": lambda root: SemanticKITTI(root, Splits(train=["00"], val=["08"], test=["11"])),
    "nuscenes": lambda root: PanopticNuScenes(
        root, splits=SceneSplits(train=["scene-0001"], val=["scene-0003"], test=["scene-0077"])
    ),
}
TREES: dict[str, Callable[[Path], Path]] = {  # sequences in all splits, that of test without labels
    "semantickitti": semantickitti_tree.write_tree,
    "nuscenes": lambda root: nuscenes_tree.write_tree(
        root, {"scene-0001": True, "scene-0003": True, "scene-0077": False}
    ),
}


@pytest.fixture(params=READERS)
def dataset(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def reader(dataset: str, tmp_path: Path) -> Reader:
    """A reader over a tiny tree."""
    return READERS[dataset](TREES[dataset](tmp_path / "tree"))


@pytest.fixture
def frame(reader: Reader) -> Frame:
    return reader.frames("train")[1]


@pytest.mark.parametrize("split", SPLITS)
def test_splits_list_their_frames_in_order(reader: Reader, split: str) -> None:
    frames = reader.frames(split)
    assert frames == sorted(set(frames))
    assert frames == [frame for sequence in reader.sequences(split) for frame in reader.key_frames(sequence)]


def test_key_frames_are_frames(reader: Reader, frame: Frame) -> None:
    frames = reader.frames_of(frame.sequence)
    assert frames == sorted(set(frames))
    assert set(reader.key_frames(frame.sequence)) <= set(reader.annotated(frame.sequence)) <= set(frames)


def test_labelled_frames_have_labels(reader: Reader) -> None:
    assert reader.labelled_frames("val") == reader.frames("val")


def test_velocities_are_told_by_neighbouring_key_frames(reader: Reader, frame: Frame) -> None:
    times = [reader.sweep(other).time for other in reader.key_frames(frame.sequence)]
    assert max(late - early for early, late in pairwise(times)) <= reader.max_gap


def test_splits_share_no_sequence(reader: Reader) -> None:
    names = [name for split in SPLITS for name in reader.sequences(split)]
    assert len(names) == len(set(names))


def test_unknown_split_is_refused(reader: Reader) -> None:
    with pytest.raises(ConfigError, match="split: expected one of train, val, test, found 'dev'"):
        reader.frames("dev")


def test_sweep_is_as_the_structures_say(reader: Reader, frame: Frame) -> None:
    sweep = reader.sweep(frame)
    assert (sweep.sequence, sweep.index) == (frame.sequence, frame.index)
    assert sweep.points.dtype == torch.float32
    assert sweep.points.shape[1] == 4
    assert 0 <= sweep.points[:, 3].min() <= sweep.points[:, 3].max() <= 1
    assert sweep.labels is not None
    assert sweep.labels.dtype == torch.int64
    assert torch.equal(sweep.labels, reader.labels(frame))
    assert torch.equal(sweep.pose, reader.poses(frame.sequence)[frame.index])


def test_poses_are_rigid_and_double(reader: Reader, frame: Frame) -> None:
    poses = reader.poses(frame.sequence)
    assert poses.dtype == torch.float64
    rotation = poses[:, :3, :3]
    torch.testing.assert_close(rotation @ rotation.mT, torch.eye(3, dtype=torch.float64).expand_as(rotation))


def test_times_go_on(reader: Reader, frame: Frame) -> None:
    times = [reader.sweep(other).time for other in reader.frames_of(frame.sequence)]
    assert times == sorted(set(times))


def test_labels_are_of_the_taxonomy(reader: Reader, frame: Frame) -> None:
    semantics = reader.taxonomy.to_training(reader.labels(frame))
    assert 0 <= semantics.min() <= semantics.max() < reader.taxonomy.num_classes
    assert reader.taxonomy.is_thing(semantics).any()


def test_test_split_has_no_labels(reader: Reader) -> None:
    frame = reader.frames("test")[0]
    assert not reader.has_labels(frame.sequence)
    assert reader.sweep(frame).labels is None
    with pytest.raises(DataError):
        reader.labels(frame)


def test_sources_are_there(reader: Reader, frame: Frame) -> None:
    large, small = reader.sources(frame.sequence)
    assert len(large) >= 2 * len(reader.key_frames(frame.sequence))
    assert all(path.is_file() for path in [*large, *small])


def test_boxes_are_of_key_frames_and_things(reader: Reader, frame: Frame) -> None:
    if not (files := reader.box_files(frame.sequence)):
        pytest.skip("this tree has no boxes")
    boxes = reader.sequence_boxes(frame.sequence)
    assert all(path.is_file() for path in files)
    assert set(boxes.frames.tolist()) <= {frame.index for frame in reader.key_frames(frame.sequence)}
    assert reader.taxonomy.is_thing(boxes.classes).all()
    assert (boxes.half_sizes > 0).all()
    assert boxes.centres.dtype == boxes.yaws.dtype == torch.float64
    assert boxes.objects.unique().tolist() == list(range(int(boxes.objects.max()) + 1))


def test_predictions_have_places_of_their_own(reader: Reader, tmp_path: Path) -> None:
    frames = [frame for split in SPLITS for frame in reader.frames(split)]
    places = {reader.prediction_path(tmp_path, frame) for frame in frames}
    assert len(places) == len(frames)
    assert all(place.is_relative_to(tmp_path) for place in places)


def test_missing_tree_says_what_to_do(dataset: str, tmp_path: Path) -> None:
    with pytest.raises(DataError) as error:
        READERS[dataset](tmp_path / "nowhere").frames("val")
    for part in (str(tmp_path / "nowhere"), "expected", "found none", "most.simulate", "_ROOT"):
        assert part in str(error.value)
