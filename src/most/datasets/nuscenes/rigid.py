"""A pose as nuScenes writes it: a translation in metres and a unit quaternion w, x, y, z."""

from pathlib import Path

import torch
from jaxtyping import Float64
from torch import Tensor

from most.datasets.nuscenes.tables import Row
from most.errors import DataError

UNIT = 1e-3  # how far off 1 a quaternion's length may be


def rigid(row: Row, table: Path) -> Float64[Tensor, "4 4"]:
    """Target_from_source of a row; a DataError names the row and its table."""
    translation, quaternion = (
        numbers(row, name, count, table) for name, count in (("translation", 3), ("rotation", 4))
    )
    if abs(float(quaternion.norm()) - 1) > UNIT:
        raise DataError(
            f"{table}: row {row['token']!r}: rotation: expected a quaternion of length 1, found {row['rotation']}"
        )
    pose = torch.eye(4, dtype=torch.float64)
    pose[:3, :3] = rotation(quaternion / quaternion.norm())
    pose[:3, 3] = translation
    return pose


def numbers(row: Row, name: str, count: int, table: Path) -> Float64[Tensor, "count"]:
    """A row's entry of ``count`` finite numbers."""
    values = row[name]
    if not all(isinstance(value, int | float) for value in values) or len(values) != count:
        raise DataError(f"{table}: row {row['token']!r}: {name}: expected {count} numbers, found {values}")
    found = torch.tensor(values, dtype=torch.float64)
    if not found.isfinite().all():
        raise DataError(f"{table}: row {row['token']!r}: {name}: expected finite numbers, found {values}")
    return found


def rotation(quaternion: Float64[Tensor, "4"]) -> Float64[Tensor, "3 3"]:
    """The matrix of a unit quaternion w, x, y, z: v v^T + (w I + [v])^2, with the part v and its cross product [v]."""
    w, x, y, z = quaternion.tolist()
    v = quaternion[1:]
    turn = torch.tensor([[w, -z, y], [z, w, -x], [-y, x, w]], dtype=torch.float64)
    return torch.outer(v, v) + turn @ turn
