"""Rigid poses: float64 [4, 4] matrices that move points from one frame to another.

A pose is named target_from_source: ``world_from_sensor @ point_in_sensor`` is the point in the world. Poses stay in
float64, since a sequence ends kilometres from where it began; points may be float32, since they stay near a sensor.
"""

import torch
from jaxtyping import Float, Float64
from torch import Tensor


def invert(pose: Float64[Tensor, "*poses 4 4"]) -> Float64[Tensor, "*poses 4 4"]:
    """Source_from_target of a rigid target_from_source: the rotation transposed, the translation turned back."""
    rotation = pose[..., :3, :3].transpose(-1, -2)
    inverse = torch.zeros_like(pose)
    inverse[..., :3, :3] = rotation
    inverse[..., :3, 3:] = -rotation @ pose[..., :3, 3:]
    inverse[..., 3, 3] = 1.0
    return inverse


def relative(target: Float64[Tensor, "4 4"], source: Float64[Tensor, "4 4"]) -> Float64[Tensor, "4 4"]:
    """Target_from_source of two sensor poses in one world."""
    return invert(target) @ source


def transform(pose: Float64[Tensor, "4 4"], points: Float[Tensor, "points 3"]) -> Float[Tensor, "points 3"]:
    """Move points by a pose, computed in float64, returned in the points' own precision."""
    moved = points.to(torch.float64) @ pose[:3, :3].T + pose[:3, 3]
    return moved.to(points.dtype)


def yaw(pose: Float64[Tensor, "*poses 4 4"]) -> Float64[Tensor, "*poses"]:
    """Heading of the pose's x axis in the target's x-y plane, radians from x towards y, in (-pi, pi]."""
    return torch.atan2(pose[..., 1, 0], pose[..., 0, 0])
