"""The files of a KITTI odometry sequence: scans, calibration, poses, times.

Scans hold float32 (x, y, z, remission) rows. ``poses.txt`` has the left camera's pose in the frame of the first camera
image, a 3 x 4 matrix a row, row i for scan i; ``calib.txt`` has camera_from_lidar as ``Tr``. The lidar's pose in the
frame of the first scan is therefore ``Tr^-1 P Tr``.
"""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float32, Float64
from torch import Tensor

from most.errors import DataError
from most.geometry.poses import invert

POINT = np.dtype(("<f4", 4))  # x, y, z, remission
POSE_NUMBERS = 12
RIGID = 1e-3  # how far off a rotation's entries may be: files print six digits or so


def read_scan(path: Path) -> Float32[Tensor, "points 4"]:
    """Read x, y, z (m, sensor) and remission in [0, 1]."""
    count_points(path)
    return torch.from_numpy(np.frombuffer(path.read_bytes(), "<f4").astype(np.float32).reshape(-1, 4))


def count_points(path: Path) -> int:
    """Count a scan's points by its size; a DataError where there is no whole number of them."""
    if not path.is_file():
        raise DataError(f"{path}: expected a scan, found no file; copy the sequence's velodyne folder again")
    size = path.stat().st_size
    if size % POINT.itemsize:
        raise DataError(
            f"{path}: expected a multiple of {POINT.itemsize} bytes (float32 x, y, z, remission a point), "
            f"found {size}; the file is cut off or no scan: copy it again"
        )
    return size // POINT.itemsize


def read_poses(folder: Path) -> Float64[Tensor, "rows 4 4"]:
    """World_from_sensor by frame number, of a sequence's folder."""
    rows = read_rows(folder / "poses.txt", POSE_NUMBERS)
    camera = torch.eye(4, dtype=torch.float64).repeat(len(rows), 1, 1)
    camera[:, :3] = rows.reshape(-1, 3, 4)
    camera_from_lidar = read_calibration(folder / "calib.txt")
    check_rigid(f"{folder / 'poses.txt'}", camera)
    check_rigid(f"{folder / 'calib.txt'}, Tr", camera_from_lidar[None])
    return invert(camera_from_lidar) @ camera @ camera_from_lidar


def check_rigid(where: str, poses: Float64[Tensor, "rows 4 4"], advice: str = "is this the official file?") -> None:
    """Raise a DataError unless each matrix of a file is rigid."""
    if bad := (~are_rigid(poses)).nonzero().flatten().tolist():
        raise DataError(
            f"{where}: expected rotations in the first three columns of each row's 3 x 4 matrix, "
            f"found none in row {bad[0]} and {len(bad) - 1} more; {advice}"
        )


def are_rigid(poses: Float64[Tensor, "rows 4 4"]) -> Bool[Tensor, "rows"]:
    """Whether each matrix turns without scaling, shearing or mirroring, to the digits that files carry."""
    rotation = poses[:, :3, :3]
    off = (rotation @ rotation.mT - torch.eye(3, dtype=torch.float64)).abs().amax((1, 2))
    return (off <= RIGID) & (torch.linalg.det(rotation) >= 0)


def read_rows(path: Path, columns: int) -> Float64[Tensor, "rows columns"]:
    """Read a text table with ``columns`` numbers a row."""
    if not path.is_file():
        raise DataError(f"{path}: expected a text file of {columns} number(s) a row, found no file")
    rows = [parse_row(f"{path}, line {n + 1}", line.split(), columns) for n, line in enumerate(read_lines(path))]
    return torch.tensor(rows, dtype=torch.float64).reshape(-1, columns)


def read_times(path: Path) -> Float64[Tensor, "rows"]:
    """Read seconds by frame number, each later than the one before."""
    times = read_rows(path, 1)[:, 0]
    if late := (times.diff() <= 0).nonzero().flatten().tolist():
        raise DataError(
            f"{path}, line {late[0] + 2}: expected a time after {times[late[0]]:.15g} s, found "
            f"{times[late[0] + 1]:.15g} s; a scan is listed twice, or the file is another's: copy it again"
        )
    return times


def read_calibration(path: Path) -> Float64[Tensor, "4 4"]:
    """Read camera_from_lidar, the line ``Tr:`` of calib.txt."""
    if not path.is_file():
        raise DataError(f"{path}: expected the sequence's calibration, found no file")
    lines = dict(line.split(":", 1) for line in read_lines(path) if ":" in line)
    if "Tr" not in lines:
        raise DataError(
            f"{path}: expected a line 'Tr: ...' (camera from lidar), found {', '.join(lines) or 'no entries'}; "
            "take calib.txt from the odometry benchmark's own archive, which has it"
        )
    matrix = torch.eye(4, dtype=torch.float64)
    row = parse_row(f"{path}, Tr", lines["Tr"].split(), POSE_NUMBERS)
    matrix[:3] = torch.tensor(row, dtype=torch.float64).reshape(3, 4)
    return matrix


def read_lines(path: Path) -> list[str]:
    """Lines of a text file, without blank ones at its end."""
    try:
        return path.read_text().rstrip().splitlines()
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: expected text, found bytes that are none ({error.reason})") from error


def parse_row(where: str, words: list[str], columns: int) -> list[float]:
    """Turn words into ``columns`` finite numbers."""
    try:
        numbers = [float(word) for word in words]
    except ValueError as error:
        raise DataError(f"{where}: expected {columns} number(s), found {' '.join(words)!r}") from error
    if len(numbers) != columns or not np.isfinite(numbers).all():
        raise DataError(f"{where}: expected {columns} finite number(s), found {len(numbers)}: {' '.join(words)[:80]!r}")
    return numbers
