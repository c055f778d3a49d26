"""A sensor's poses in one text file, as other programs write them: KITTI's rows of 12 numbers, or TUM's of 8."""

from pathlib import Path

import torch
from jaxtyping import Float64
from scipy.spatial.transform import Rotation
from torch import Tensor

from most.datasets.kitti_files import POSE_NUMBERS, check_rigid, parse_row, read_lines
from most.errors import DataError

TUM_NUMBERS = 8  # time (s), x, y, z (m), and a quaternion x, y, z, w


def read_pose_file(path: Path) -> tuple[Float64[Tensor, "rows 4 4"], Float64[Tensor, "rows"] | None]:
    """Read world_from_sensor, a row for each scan, and their times where the file has them.

    A KITTI row is the upper 3 x 4 matrix. Unlike ``poses.txt`` of the benchmark these are the sensor's own poses, not a
    camera's. Lines that begin with # are comments. Raises DataError for anything else.
    """
    if not path.is_file():
        raise DataError(f"{path}: expected a file of poses, found none")
    lines = numbered_rows(path)
    width = len(lines[0][1]) if lines else POSE_NUMBERS
    if width not in (POSE_NUMBERS, TUM_NUMBERS):
        raise DataError(
            f"{path}, line {lines[0][0]}: expected {POSE_NUMBERS} numbers (a 3 x 4 matrix, world from sensor) or "
            f"{TUM_NUMBERS} (time, position, quaternion x y z w), found {width}"
        )
    rows = [parse_row(f"{path}, line {number}", words, width) for number, words in lines]
    table = torch.tensor(rows, dtype=torch.float64).reshape(-1, width)
    poses, times = (_from_tum(path, table), table[:, 0]) if width == TUM_NUMBERS else (_from_matrices(table), None)
    check_rigid(str(path), poses, "is it a file of poses, world from sensor?")
    return poses, times


def numbered_rows(path: Path) -> list[tuple[int, list[str]]]:
    """Return the words of each row of a text file, and the line where it stands; comments are none."""
    return [(number, line.split()) for number, line in enumerate(read_lines(path), 1) if line.lstrip()[:1] != "#"]


def _from_matrices(table: Float64[Tensor, "rows 12"]) -> Float64[Tensor, "rows 4 4"]:
    poses = torch.eye(4, dtype=torch.float64).repeat(len(table), 1, 1)
    poses[:, :3] = table.reshape(-1, 3, 4)
    return poses


def _from_tum(path: Path, table: Float64[Tensor, "rows 8"]) -> Float64[Tensor, "rows 4 4"]:
    poses = torch.eye(4, dtype=torch.float64).repeat(len(table), 1, 1)
    if bad := (table[:, 4:].norm(dim=1) == 0).nonzero().flatten().tolist():
        raise DataError(f"{path}: expected a quaternion in each row, found zeros in row {bad[0]}")
    poses[:, :3, :3] = torch.from_numpy(Rotation.from_quat(table[:, 4:].numpy()).as_matrix())
    poses[:, :3, 3] = table[:, 1:4]
    return poses
