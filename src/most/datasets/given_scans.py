"""What a program hands over of a scan, in whatever arrays it has it: points, pose and time, checked and copied."""

from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64
from torch import Tensor

from most.datasets.kitti_files import are_rigid
from most.errors import DataError

LAST_ROW = (0.0, 0.0, 0.0, 1.0)  # of a 4 x 4 pose
ROUNDING = 1e-6  # by which it may be off


def as_scan(points: Any) -> Float32[Tensor, "points 4"]:
    """Return x, y, z and intensity, which is 0 where there is none; a DataError for what is no N x 3 or N x 4."""
    scan = _as_numbers("points", points, np.float32)
    if scan.ndim != 2 or scan.shape[1] not in (3, 4):
        raise DataError(
            f"points: expected N x 3 (x, y, z) or N x 4 (and intensity), found the shape {tuple(scan.shape)}"
        )
    return torch.nn.functional.pad(scan, (0, 4 - scan.shape[1]))


def as_pose(pose: Any) -> Float64[Tensor, "4 4"]:
    """Return world_from_sensor; a DataError unless it is rigid, to the digits that files carry, or not finite."""
    matrix = _as_numbers("pose", pose, np.float64)
    if matrix.shape != (4, 4):
        raise DataError(f"pose: expected world_from_sensor, 4 x 4, found the shape {tuple(matrix.shape)}")
    if bool(matrix.isfinite().all()):
        if not bool(are_rigid(matrix[None])):
            raise DataError(
                "pose: expected a rotation in the first three rows and columns, found one that scales, shears or "
                f"mirrors: {matrix[:3, :3].tolist()}; give world_from_sensor"
            )
        last = matrix.new_tensor(LAST_ROW)
        if float((matrix[3] - last).abs().max()) > ROUNDING:
            raise DataError(f"pose: expected 0 0 0 1 in the last row, found {matrix[3].tolist()}; is it transposed?")
        matrix[3] = last
    return matrix


def as_seconds(timestamp: Any) -> float:
    """Return a time in seconds; a DataError for what is no number, as a message's stamp."""
    try:
        return float(timestamp)
    except (TypeError, ValueError, OverflowError, RuntimeError) as error:
        raise DataError(
            f"timestamp: expected seconds, found {type(timestamp).__name__}; give a number: "
            "of a stamp of ROS its seconds, and 1e-9 times its nanoseconds"
        ) from error


def _as_numbers(what: str, values: Any, kind: type[np.floating]) -> Float[Tensor, "..."]:
    """Return a copy of the values on the CPU: the caller may use its memory again."""
    if isinstance(values, Tensor) and not values.is_complex():
        return values.detach().to("cpu", torch.float32 if kind is np.float32 else torch.float64, copy=True)
    try:
        array = np.asarray(values)
    except (ValueError, TypeError, RuntimeError) as error:
        raise DataError(f"{what}: expected one array of numbers, found rows that make none ({error})") from error
    if array.dtype.kind not in "fiub":
        advice = "; numpy.lib.recfunctions.structured_to_unstructured makes one of fields" if array.dtype.names else ""
        raise DataError(f"{what}: expected an array of numbers, found {array.dtype} ({type(values).__name__}){advice}")
    with np.errstate(over="ignore"):  # what is too large for float32 is infinite, and no input
        return torch.from_numpy(array.astype(kind, order="C"))
