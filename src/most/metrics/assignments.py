"""``detections/NAME.npz`` beside the folder of a prediction: what stands behind it, kept for the membership accuracy.

Arrays: ``classes scores centres extents velocities roi`` with a row for each detection, in the sensor frame (m),
``yaws`` (radians) where boxes are turned, and ``assigned`` (int32, a number for each point): the detection that claims
the point, -1 for none.
"""

import zipfile
import zlib
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from most.errors import DataError
from most.files import atomic_write
from most.structures import Detections

WIDTHS = {"classes": (), "scores": (), "centres": (3,), "extents": (3,), "velocities": (2,), "roi": (3,), "yaws": ()}
OPTIONAL = ("yaws",)


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


def read_assignments(path: Path) -> Assignments:
    """Read one sweep's assignments; raises DataError for a file that does not hold them."""
    arrays = _arrays(path)
    count = len(arrays["classes"])
    widths = {name: width for name, width in WIDTHS.items() if name in arrays}
    for name, width in widths.items():
        if arrays[name].shape != (count, *width):
            raise DataError(f"{path}: {name}: expected shape {(count, *width)}, found {arrays[name].shape}")
    assigned = arrays["assigned"]
    if assigned.ndim != 1 or (assigned.size and not -1 <= assigned.min() <= assigned.max() < count):
        raise DataError(f"{path}: assigned: expected for each point a number from -1 to {count - 1}, found others")
    tensors = {name: torch.from_numpy(arrays[name].astype(np.float32)) for name in widths if name != "classes"}
    roi = tensors.pop("roi")
    classes = torch.from_numpy(arrays["classes"].astype(np.int64))
    return Assignments(Detections(classes, **tensors), roi, torch.from_numpy(assigned.astype(np.int64)))


def _arrays(path: Path) -> dict[str, np.ndarray]:
    names = [name for name in (*WIDTHS, "assigned") if name not in OPTIONAL]
    try:
        with zipfile.ZipFile(path) as archive:
            missing = [name for name in names if f"{name}.npy" not in archive.namelist()]
        if missing:
            raise DataError(f"{path}: expected arrays {', '.join(names)}, found no {', '.join(missing)}")
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files if name in (*names, *OPTIONAL)}
    except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, OSError) as error:
        raise DataError(f"{path}: expected an .npz file of detections, found none readable ({error})") from error
