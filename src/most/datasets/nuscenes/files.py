"""The files of nuScenes' lidar: sweeps, classes, panoptic labels.

A sweep is rows of float32 x, y, z (m, sensor frame: x right, y ahead), intensity (0 to 255) and ring (beam). Classes
are a uint8 a point, panoptic labels a uint16 a point: class * 1000 + instance, in the archive's array ``data``.
"""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float32, Int64
from torch import Tensor

from most.errors import DataError
from most.files import NO_ARCHIVE, atomic_write

POINT = np.dtype(("<f4", 5))
BRIGHTEST = 255.0


def read_scan(path: Path, token: str) -> Float32[Tensor, "points 4"]:
    """Read x, y, z (m, sensor) and intensity in [0, 1] of the sample_data ``token``."""
    count_points(path, token)
    points = np.frombuffer(path.read_bytes(), "<f4").astype(np.float32).reshape(-1, 5)[:, :4].copy()
    points[:, 3] /= BRIGHTEST
    return torch.from_numpy(points)


def count_points(path: Path, token: str) -> int:
    """Count a sweep's points by its size; a DataError where there is no whole number of them."""
    if not path.is_file():
        raise DataError(
            f"{path}: expected the sweep of sample_data {token}, found no file; copy samples/LIDAR_TOP and "
            "sweeps/LIDAR_TOP again, or do without the sweeps between key frames: dataset.sweeps=0"
        )
    size = path.stat().st_size
    if size % POINT.itemsize:
        raise DataError(
            f"{path}: expected a multiple of {POINT.itemsize} bytes (float32 x, y, z, intensity, ring a point) of "
            f"sample_data {token}, found {size}; the file is cut off or no sweep: copy it again"
        )
    return size // POINT.itemsize


def read_classes(path: Path) -> Int64[Tensor, "points"]:
    """Read the categories (0 to 31) of nuScenes-lidarseg, widened to int64."""
    if not path.is_file():
        raise DataError(f"{path}: expected a file of point classes, found none; copy the folder lidarseg again")
    return torch.from_numpy(np.frombuffer(path.read_bytes(), np.uint8).astype(np.int64))


def read_panoptic(path: Path) -> Int64[Tensor, "points"]:
    """Read panoptic labels, widened to int64; a DataError tells a missing file or one that holds something else."""
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path}: expected panoptic labels, found no file; check the folder, or predict first")
    try:
        with np.load(path, allow_pickle=False) as archive:
            labels = archive["data"]
    except NO_ARCHIVE as error:
        raise DataError(
            f"{path}: expected an archive with the array data, found something else ({error}); copy it again"
        ) from error
    if labels.dtype != np.uint16 or labels.ndim != 1:
        raise DataError(f"{path}: expected data of uint16, one a point, found {labels.dtype} of shape {labels.shape}")
    return torch.from_numpy(labels.astype(np.int64))


def write_panoptic(path: Path, labels: Int64[Tensor, "points"]) -> None:
    """Write panoptic labels atomically, the same bytes every time; they must fit an unsigned 16-bit integer."""
    if labels.numel() and not 0 <= int(labels.min()) <= int(labels.max()) < 1 << 16:
        raise DataError(f"{path}: expected labels in 0..65535, found {int(labels.min())}..{int(labels.max())}")
    with atomic_write(Path(path)) as file:
        np.savez_compressed(file, data=labels.cpu().numpy().astype("<u2"))
