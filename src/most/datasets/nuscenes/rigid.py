"""A pose as nuScenes writes it: a translation in metres and a unit quaternion w, x, y, z."""

from pathlib import Path

import torch
from jaxtyping import Float64
from torch import Tensor

from most.datasets.nuscenes.tables import Row
from most.errors import DataError

UNIT = 1e-3  # how far off 1 a quaternion's length may be


def rigid(rows: list[Row], table: Path) -> Float64[Tensor, "rows 4 4"]:
    """Target_from_source of rows; a DataError names the row and its table."""
    translations, quaternions = numbers(rows, "translation", 3, table), numbers(rows, "rotation", 4, table)
    lengths = quaternions.norm(dim=1, keepdim=True)
    for index in ((lengths - 1).abs() > UNIT).nonzero()[:1, 0].tolist():
        raise _fault(rows[index], "rotation", "a quaternion of length 1", table)
    poses = torch.eye(4, dtype=torch.float64).repeat(len(rows), 1, 1)
    poses[:, :3, :3] = rotations(quaternions / lengths)
    poses[:, :3, 3] = translations
    return poses


def numbers(rows: list[Row], name: str, count: int, table: Path) -> Float64[Tensor, "rows count"]:
    """The rows' entries of ``count`` finite numbers."""
    for row in rows:
        if len(row[name]) != count or not all(isinstance(value, int | float) for value in row[name]):
            raise _fault(row, name, f"{count} numbers", table)
    found = torch.tensor([row[name] for row in rows], dtype=torch.float64).reshape(-1, count)
    for index in found.isfinite().all(1).logical_not().nonzero()[:1, 0].tolist():
        raise _fault(rows[index], name, "finite numbers", table)
    return found


def rotations(quaternions: Float64[Tensor, "rows 4"]) -> Float64[Tensor, "rows 3 3"]:
    """The matrices of unit quaternions w, x, y, z: v v^T + (w I + [v])^2, with the part v and its cross product [v]."""
    w, x, y, z = quaternions.T
    v = quaternions[:, 1:]
    turn = torch.stack([w, -z, y, z, w, -x, -y, x, w], 1).view(-1, 3, 3)
    return v[:, :, None] * v[:, None] + turn @ turn


def _fault(row: Row, name: str, expected: str, table: Path) -> DataError:
    return DataError(f"{table}: row {row['token']!r}: {name}: expected {expected}, found {row[name]}")
