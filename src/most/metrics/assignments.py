"""``detections/NAME.npz`` beside the folder of a prediction: what stands behind it, kept for the membership accuracy.

Arrays: ``classes scores centres extents velocities roi`` with a row for each detection, in the sensor frame (m),
``yaws`` (radians) where boxes are turned, and ``assigned`` (int32, a number for each point): the detection that claims
the point, -1 for none.
"""

import zipfile
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from most.errors import DataError
from most.files import NO_ARCHIVE, atomic_write
from most.structures import Detections

WIDTHS = {"classes": (), "scores": (), "centres": (3,), "extents": (3,), "velocities": (2,), "roi": (3,), "yaws": ()}
OPTIONAL = ("yaws",)
WHOLE = ("classes", "assigned")


@dataclass
class Assignments:
    """The detections of one sweep and the points that they claim."""

    detections: Detections
    roi: Float[Tensor, "detections 3"]  # half-sizes of the regions of interest, m
    assigned: Int64[Tensor, "points"]


def assignments_path(prediction: Path) -> Path:
    """Where the assignments of a prediction lie: in the folder ``detections`` beside the prediction's own."""
    return prediction.parent.parent / "detections" / f"{prediction.stem}.npz"


def write_assignments(path: Path, assignments: Assignments) -> None:
    """Write one sweep's assignments."""
    detections = assignments.detections
    arrays = {field.name: getattr(detections, field.name) for field in fields(detections)} | {"roi": assignments.roi}
    there = {name: tensor for name, tensor in arrays.items() if tensor is not None}
    with atomic_write(path) as file:
        np.savez_compressed(
            file,
            assigned=assignments.assigned.cpu().numpy().astype(np.int32),
            **{name: tensor.detach().cpu().numpy() for name, tensor in there.items()},
        )


def read_assignments(path: Path, num_classes: int | None = None) -> Assignments:
    """Read one sweep's assignments; raises DataError for a file that does not hold them.

    ``num_classes`` of the taxonomy that the file's classes are training ids of; None takes any.
    """
    arrays = _arrays(path)
    count = arrays["classes"].size
    for name, width in WIDTHS.items():
        if name in arrays:
            _check_numbers(f"{path}: {name}", arrays[name], (count, *width), name)
    _check_ids(f"{path}: classes: expected class ids", arrays["classes"], 0, num_classes)
    if arrays["assigned"].ndim != 1:
        raise DataError(f"{path}: assigned: expected a number for each point, found shape {arrays['assigned'].shape}")
    _check_ids(f"{path}: assigned: expected for each point a number", arrays["assigned"], -1, count)
    numbers = {name: array for name, array in arrays.items() if name not in WHOLE}
    tensors = {name: torch.from_numpy(array.astype(np.float32)) for name, array in numbers.items()}
    roi = tensors.pop("roi")
    classes, assigned = (torch.from_numpy(arrays[name].astype(np.int64)) for name in WHOLE)
    return Assignments(Detections(classes, **tensors), roi, assigned)


def _check_numbers(where: str, array: np.ndarray, shape: tuple[int, ...], name: str) -> None:
    """Refuse an array of another shape or kind; only velocities may be unknown."""
    if array.shape != shape:
        raise DataError(f"{where}: expected shape {shape}, found {array.shape}")
    if array.dtype.kind not in ("iu" if name in WHOLE else "fiu"):
        raise DataError(f"{where}: expected {'whole ' * (name in WHOLE)}numbers, found {array.dtype}")
    if name != "velocities" and not np.isfinite(array.astype(np.float32)).all():
        raise DataError(f"{where}: expected finite numbers, found others; predict the scan again")


def _check_ids(what: str, ids: np.ndarray, first: int, end: int | None) -> None:
    """Refuse what are no whole numbers, or are out of range."""
    last = "on" if end is None else f"to {end - 1}"
    if ids.dtype.kind not in "iu":
        raise DataError(f"{what} from {first} {last}, found {ids.dtype}")
    if ids.size and (ids.min() < first or (end is not None and ids.max() >= end)):
        raise DataError(f"{what} from {first} {last}, found {ids.min()} to {ids.max()}")


def _arrays(path: Path) -> dict[str, np.ndarray]:
    names = [name for name in (*WIDTHS, "assigned") if name not in OPTIONAL]
    try:
        with zipfile.ZipFile(path) as archive:
            missing = [name for name in names if f"{name}.npy" not in archive.namelist()]
        if missing:
            raise DataError(f"{path}: expected arrays {', '.join(names)}, found no {', '.join(missing)}")
        with np.load(path, allow_pickle=False) as arrays:
            return {name: np.asarray(arrays[name]) for name in arrays.files if name in (*names, *OPTIONAL)}
    except NO_ARCHIVE as error:
        raise DataError(f"{path}: expected an .npz file of detections, found none readable ({error})") from error
