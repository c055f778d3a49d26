"""Windows in the order of time, from sweeps that are read once."""

from collections import Counter

import pytest
import torch

from most.datasets.dataset import WindowDataset
from most.datasets.reader import Frame
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.datasets.window_stream import WindowStream
from semantickitti_tree import write_sequence


@pytest.fixture
def reader(tmp_path, monkeypatch):
    """Two sequences, of which the second lacks a scan; ``reads`` counts."""
    write_sequence(tmp_path, "00", range(4))
    folder = write_sequence(tmp_path, "01", range(7))
    for kind, suffix in {"velodyne": "bin", "labels": "label"}.items():
        (folder / kind / f"000003.{suffix}").unlink()
    made, reads = SemanticKITTI(tmp_path, Splits(val=["00", "01"])), Counter()
    plain = made.sweep

    def counted(frame):
        reads[frame] += 1
        return plain(frame)

    monkeypatch.setattr(made, "sweep", counted)
    made.reads = reads
    return made


@pytest.mark.parametrize("previous", [0, 1, 3, 10])
def test_windows_are_those_of_training_and_each_sweep_is_read_once(reader, previous):
    frames = reader.frames("val")
    windows = list(WindowStream(reader, frames, previous))
    assert reader.reads == Counter(frames)
    for window, sample in zip(windows, WindowDataset(reader, frames, previous), strict=True):
        assert (window.sweep.sequence, window.sweep.index) == (sample.sequence, sample.index)
        assert torch.equal(window.points, sample.points)
        assert torch.equal(window.sample().points, sample.points)
        assert window.sample().num_current == sample.num_current


def test_only_what_a_window_takes_in_is_read(reader):
    windows = list(WindowStream(reader, [Frame("01", 2), Frame("01", 6)], previous=1))
    assert [window.sweep.index for window in windows] == [2, 6]
    assert sorted(frame.index for frame in reader.reads) == [1, 2, 5, 6]


@pytest.mark.parametrize("ahead", [False, True])
def test_a_process_that_reads_ahead_changes_nothing(reader, ahead):
    frames = reader.frames("val")
    windows = list(WindowStream(reader, frames, 2).load(ahead))
    plain = list(WindowStream(reader, frames, 2))
    assert all(torch.equal(one.points, other.points) for one, other in zip(windows, plain, strict=True))
