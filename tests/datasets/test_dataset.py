from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import Tensor
from torch.utils.data import DataLoader

from most.datasets.augment import Augment
from most.datasets.dataset import WindowDataset
from most.datasets.instances import InstanceTables
from most.datasets.reader import Frame
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.errors import DataError
from most.geometry.poses import relative, transform
from most.geometry.similarity import Similarity
from most.modal.extent import ShrinkWrap, TrackMax
from most.structures import Instances, Sample
from semantickitti_tree import CAR, PARKED

AUGMENT = Augment(flip_x=True, flip_y=True, rotation=45.0, scale=[0.9, 1.1], translation=[0.5, 0.5, 0.5])
FLOOR = 1e-3  # m; below every size in the tree that is not 0


@pytest.fixture
def reader(tree: Path) -> SemanticKITTI:
    return SemanticKITTI(tree, Splits(train=["00"], val=["08"], test=["11"]))


@pytest.fixture
def make(reader: SemanticKITTI, tmp_path: Path) -> Callable[..., WindowDataset]:
    """A dataset over a split; options as WindowDataset has them."""

    def build(split: str = "train", previous: int = 2, **options: object) -> WindowDataset:
        tables = InstanceTables(reader, ShrinkWrap(FLOOR), tmp_path / "tables")
        return WindowDataset(reader, reader.frames(split), previous, instances=tables, **options)  # type: ignore[arg-type]

    return build


def assert_same(one: Sample, other: Sample) -> None:
    assert (one.sequence, one.index, one.num_current) == (other.sequence, other.index, other.num_current)
    assert torch.equal(one.points, other.points)
    assert one.instances is not None
    assert other.instances is not None
    assert torch.equal(one.instances.centres, other.instances.centres)
    assert torch.equal(one.instances.extents, other.instances.extents)


def test_sample_holds_the_window_and_the_current_truth(make: Callable[..., WindowDataset]) -> None:
    sample = make()[3]
    assert (sample.sequence, sample.index) == ("00", 3)
    assert sample.num_current == 9  # 4 of the car, 2 of the parked one, 3 of the road
    assert len(sample.points) == 9 + 8 + 9
    assert sample.points[:9, 4].tolist() == [0.0] * 9
    torch.testing.assert_close(sample.points[9:, 4], torch.tensor([-0.1] * 8 + [-0.2] * 9))
    assert sample.labels is not None
    assert sample.semantics is not None
    assert sample.labels.tolist() == [CAR] * 4 + [PARKED] * 2 + [40, 40, 0]
    assert sample.semantics.tolist() == [1] * 6 + [9, 9, 0]
    assert sample.instances is not None
    assert sample.instances.keys.tolist() == [PARKED, CAR]
    assert sample.instances.counts.tolist() == [2, 4]


def test_static_points_of_past_sweeps_fall_onto_current_ones(make: Callable[..., WindowDataset]) -> None:
    points = make()[3].points
    torch.testing.assert_close(points[6:9, :3], points[14:17, :3], atol=1e-5, rtol=0)  # road, one sweep before
    torch.testing.assert_close(points[6:9, :3], points[23:26, :3], atol=1e-5, rtol=0)


def test_sequence_start_has_fewer_sweeps(make: Callable[..., WindowDataset]) -> None:
    dataset = make(previous=10)
    assert [len(dataset[index].points) for index in range(3)] == [8, 8 + 9, 8 + 9 + 8]


def test_unlabelled_split_has_no_truth(make: Callable[..., WindowDataset]) -> None:
    sample = make("test")[1]
    assert sample.labels is None
    assert sample.semantics is None
    assert sample.instances is None
    assert sample.num_current == 9


def test_label_outside_the_class_map_names_the_frame(make: Callable[..., WindowDataset], tree: Path) -> None:
    dataset = make()
    dataset.instances = None
    path = tree / "sequences/00/labels/000001.label"
    path.write_bytes(b"\x90\x01\x00\x00" * 9)  # raw class 400
    with pytest.raises(DataError, match=r"sequence='00', index=1.* found 400"):
        dataset[1]


@pytest.mark.parametrize("cache", [False, True])
def test_augmentation_depends_on_seed_epoch_and_index_alone(make: Callable[..., WindowDataset], cache: bool) -> None:
    dataset, other = make(augment=AUGMENT, seed=5, cache=cache), make(augment=AUGMENT, seed=5, cache=cache)
    first = [dataset[index] for index in range(4)]
    for index in (2, 0, 3, 1):
        assert_same(other[index], first[index])
    other.set_epoch(1)
    assert not torch.equal(other[2].points, first[2].points)
    other.set_epoch(0)
    assert_same(other[2], first[2])
    assert not torch.equal(make(augment=AUGMENT, seed=6)[2].points, first[2].points)


def test_workers_make_the_same_samples_and_hear_of_new_epochs(make: Callable[..., WindowDataset]) -> None:
    dataset, reference = make(augment=AUGMENT), make(augment=AUGMENT)
    loader = DataLoader(dataset, batch_size=2, num_workers=2, persistent_workers=True, collate_fn=list)
    for epoch in (0, 1):
        dataset.set_epoch(epoch)
        reference.set_epoch(epoch)
        samples = [sample for batch in loader for sample in batch]
        for index, sample in enumerate(samples):
            assert_same(sample, reference[index])


def half_sizes(points: Tensor) -> Tensor:
    """Half-sizes about the mean, along the axes; where there are none, the floor."""
    return (points - points.mean(0)).abs().amax(0).clamp(min=FLOOR)


def others_in(reader: SemanticKITTI, index: int, key: int, change: Similarity) -> dict[int, tuple[Tensor, float]]:
    """An instance's points of each scan of sequence 00, moved into scan ``index`` and changed; with the scan's time."""
    here = reader.sweep(Frame("00", index))
    found = {}
    for frame in reader.frames_of("00"):
        sweep = reader.sweep(frame)
        assert sweep.labels is not None
        moved = transform(relative(here.pose, sweep.pose), sweep.points[sweep.labels == key, :3].double())
        found[frame.index] = change.apply(moved), sweep.time
    return found


@pytest.mark.parametrize("index", [0, 1, 2, 3])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("strategy", [ShrinkWrap(FLOOR), TrackMax(FLOOR)], ids=["shrink_wrap", "track_max"])
def test_instances_of_an_augmented_window_are_those_of_its_points(
    reader: SemanticKITTI, tmp_path: Path, index: int, seed: int, strategy: ShrinkWrap | TrackMax
) -> None:
    tables = InstanceTables(reader, strategy, tmp_path / "tables")
    seen: list[Similarity] = []

    def lookup(frame: Frame, change: Similarity) -> Instances:
        seen.append(change)
        return tables(frame, change)

    sample = WindowDataset(reader, reader.frames("train"), 2, AUGMENT, lookup, seed)[index]
    assert sample.labels is not None
    assert sample.instances is not None
    for row, key in enumerate(sample.instances.keys.tolist()):
        points = sample.points[: sample.num_current, :3][sample.labels == key]
        track = others_in(reader, index, key, seen[0])
        sizes = half_sizes(points)
        if isinstance(strategy, TrackMax):
            sizes = torch.stack([half_sizes(points) for points, _ in track.values()]).amax(0).float()
        before, after = max(index - 1, 0), min(index + 1, 3)
        step = (track[after][0].mean(0) - track[before][0].mean(0)) / (track[after][1] - track[before][1])
        torch.testing.assert_close(sample.instances.centres[row], points.mean(0), atol=1e-5, rtol=0)
        torch.testing.assert_close(sample.instances.extents[row], sizes, atol=1e-5, rtol=0)
        torch.testing.assert_close(sample.instances.velocities[row], step[:2].float(), atol=1e-4, rtol=0)
    assert sample.instances.velocity_known.all()
