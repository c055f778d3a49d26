import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from most.geometry.poses import invert, relative, transform, yaw


def pose(angle: float, x: float, y: float, z: float, tilt: float = 0.0) -> Tensor:
    """Turn by ``tilt`` about x, then by ``angle`` about z, then move."""
    c, s, ct, st_ = math.cos(angle), math.sin(angle), math.cos(tilt), math.sin(tilt)
    turn = torch.tensor([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=torch.float64)
    lean = torch.tensor([[1, 0, 0], [0, ct, -st_], [0, st_, ct]], dtype=torch.float64)
    result = torch.eye(4, dtype=torch.float64)
    result[:3, :3] = turn @ lean
    result[:3, 3] = torch.tensor([x, y, z])
    return result


lengths = st.floats(-1e4, 1e4)
poses = st.builds(pose, st.floats(-3.1, 3.1), lengths, lengths, lengths, st.floats(-1.5, 1.5))


def test_quarter_turn_by_hand() -> None:
    world_from_sensor = pose(math.pi / 2, 10, 0, 1)
    points = torch.tensor([[1.0, 0.0, 0.0], [0.0, 2.0, 5.0]])
    moved = transform(world_from_sensor, points)
    torch.testing.assert_close(moved, torch.tensor([[10.0, 1.0, 1.0], [8.0, 0.0, 6.0]]))
    assert moved.dtype == torch.float32


def test_relative_pose_by_hand() -> None:
    here, there = pose(0, 5, 0, 0), pose(0, 3, 1, 0)  # what the other sensor sees at 0 lies 2 m behind, 1 m to the left
    torch.testing.assert_close(transform(relative(here, there), torch.zeros(1, 3)), torch.tensor([[-2.0, 1.0, 0.0]]))


@given(poses)
def test_inverse_undoes(target_from_source: Tensor) -> None:
    product = invert(target_from_source) @ target_from_source
    torch.testing.assert_close(product, torch.eye(4, dtype=torch.float64), atol=1e-10, rtol=0)


@given(poses, poses)
def test_relative_goes_by_the_world(target: Tensor, source: Tensor) -> None:
    points = torch.tensor([[1.0, -2.0, 0.5]], dtype=torch.float64)
    by_world = transform(invert(target), transform(source, points))
    torch.testing.assert_close(transform(relative(target, source), points), by_world, atol=1e-8, rtol=0)


@given(poses)
def test_stack_of_poses_is_inverted_each(one: Tensor) -> None:
    stack = torch.stack([one, torch.eye(4, dtype=torch.float64)])
    torch.testing.assert_close(invert(stack)[0], invert(one))


def test_far_from_the_origin_points_keep_their_precision() -> None:
    here, there = pose(0.3, 9000.0, -7000.0, 50.0), pose(0.3, 9001.0, -7000.0, 50.0)
    moved = transform(relative(here, there), torch.zeros(1, 3))
    expected = torch.tensor([[math.cos(0.3), -math.sin(0.3), 0.0]])
    torch.testing.assert_close(moved, expected, atol=1e-6, rtol=0)


@pytest.mark.parametrize("angle", [-3.0, -0.5, 0.0, 0.7, 3.0])
def test_yaw_is_the_heading(angle: float) -> None:
    assert float(yaw(pose(angle, 1, 2, 3, tilt=0.4))) == pytest.approx(angle)
    assert yaw(torch.stack([pose(angle, 0, 0, 0)] * 2)).shape == (2,)
