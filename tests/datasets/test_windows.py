import math

import pytest
import torch
from torch import Tensor

from most.datasets.reader import Frame
from most.datasets.windows import gather_window, previous_frames
from most.structures import Sweep


def sweep(index: int, points: list[list[float]], pose: Tensor | None = None) -> Sweep:
    pose = torch.eye(4, dtype=torch.float64) if pose is None else pose
    return Sweep("00", index, torch.tensor(points), pose, 100 + 0.1 * index, None)


def test_previous_sweeps_are_the_latest_first() -> None:
    frames = [Frame("00", index) for index in range(6)]
    assert previous_frames(frames, Frame("00", 4), 2) == [Frame("00", 3), Frame("00", 2)]
    assert previous_frames(frames, Frame("00", 4), 0) == []


def test_sequence_start_and_gaps_use_what_is_there() -> None:
    frames = [Frame("00", index) for index in (0, 1, 5, 6)]
    assert previous_frames(frames, Frame("00", 0), 10) == []
    assert previous_frames(frames, Frame("00", 1), 10) == [Frame("00", 0)]
    assert previous_frames(frames, Frame("00", 6), 3) == [Frame("00", 5)]


def test_past_points_are_moved_into_the_current_sensor_frame() -> None:
    pose = torch.tensor([[0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=torch.float64)
    current = sweep(3, [[1, 2, 3, 0.5], [4, 5, 6, 0.25]], pose)  # stands at x = 5 and looks along the world's y
    past = sweep(1, [[5, 2, 1, 0.75]])  # in the world: 2 m ahead of the current sensor
    window = gather_window(current, [past])
    expected = torch.tensor([[1, 2, 3, 0.5, 0], [4, 5, 6, 0.25, 0], [2, 0, 1, 0.75, -0.2]])
    torch.testing.assert_close(window, expected)
    assert window.dtype == torch.float32


def test_sweeps_before_a_long_pause_are_left_out() -> None:
    current = sweep(110, [[1, 2, 3, 0.5]])
    window = gather_window(current, [sweep(11, [[1, 1, 1, 0.5]]), sweep(9, [[2, 2, 2, 0.5]])])
    assert window[:, 4].tolist() == pytest.approx([0, -9.9])


def test_current_points_stay_as_they_are_whatever_they_are() -> None:
    current = sweep(0, [[math.nan, 1, math.inf, 0.1], [2, 2, 2, 0.2]], 3 * torch.eye(4, dtype=torch.float64))
    window = gather_window(current, [])
    assert torch.equal(window[:, :4].nan_to_num(), current.points.nan_to_num())
    assert current.points.data_ptr() != window.data_ptr()
