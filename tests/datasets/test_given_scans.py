"""What is no scan, pose or time is said so in one message; anything that is, however it lies in memory, is taken."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from most.datasets.given_scans import as_pose, as_scan, as_seconds
from most.errors import DataError


@pytest.mark.parametrize(
    "points",
    [
        np.array([[1, 2, 3], [4, 5, 6]], ">i8"),
        np.array([[4, 5, 6], [1, 2, 3]], np.uint16)[::-1],
        [[1, 2, 3], [4, 5, 6]],
        torch.tensor([[1.0, 2, 3], [4, 5, 6]], requires_grad=True),
    ],
)
def test_points_come_in_any_array(points):
    assert as_scan(points).tolist() == [[1, 2, 3, 0], [4, 5, 6, 0]]


@pytest.mark.parametrize(
    "points", [None, "points", [["1", "2", "x"]], [[None] * 3], torch.zeros(2, 3, dtype=torch.cfloat)]
)
def test_what_is_no_array_of_numbers_is_refused(points):
    with pytest.raises(DataError, match=r"points: expected (an|one) array of numbers, found"):
        as_scan(points)


@pytest.mark.parametrize("stamp", [SimpleNamespace(sec=1, nanosec=5), "now", [1.0, 2.0], 10**400])
def test_stamps_that_are_no_seconds_are_refused(stamp):
    with pytest.raises(DataError, match=r"timestamp: expected seconds, found .*1e-9 times its nanoseconds"):
        as_seconds(stamp)


def test_the_message_of_a_pose_speaks_of_no_file():
    with pytest.raises(DataError, match=r"pose: expected a rotation .* found .* \[\[2.0") as refused:
        as_pose(2 * np.eye(4))
    assert "row 0" not in str(refused.value)
    assert "file" not in str(refused.value)
