"""Single scans of any sensor: ``.bin``, ``.npy``, ``.pcd`` and ``.ply`` files, each read into x, y, z and intensity.

Every row of a file is a point of its scan, in the file's order: points that are not finite stay, since every point
needs a label. PLY files are read by trimesh, PCD files (ASCII, binary, compressed) by pypcd4, which is an extra; a
PCD's ``VIEWPOINT`` is no pose of a sequence and is ignored.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
import torch
from jaxtyping import Float32, Num
from torch import Tensor
from trimesh.exchange.ply import load_ply

from most.errors import ConfigError, DataError

INTENSITY = ("intensity", "reflectivity", "reflectance", "remission", "i", "scalar_intensity")  # names, in lower case
FLOAT = np.dtype("<f4")


def read_scan_file(path: Path, columns: int) -> Float32[Tensor, "points 4"]:
    """Read x, y, z (m, sensor) and intensity as it lies on disk, 0 where the file has none.

    ``columns`` is how many numbers a point has in a ``.bin``. Raises DataError for a file that is no whole scan.
    """
    suffix = path.suffix.lower()
    rows = _read_bin(path, columns) if suffix == ".bin" else READERS[suffix](path)
    points = np.zeros((len(rows), 4), np.float32)
    with np.errstate(over="ignore"):  # what is too large for float32 is infinite, and no input
        points[:, : rows.shape[1]] = rows[:, :4]
    return torch.from_numpy(points)


def check_size(path: Path, columns: int) -> None:
    """Refuse a ``.bin`` whose size is no whole number of points; whether ``columns`` is right, nothing else tells."""
    size, row = path.stat().st_size, columns * FLOAT.itemsize
    if path.suffix.lower() == ".bin" and size % row:
        fitting = [str(width) for width in range(3, 9) if size % (width * FLOAT.itemsize) == 0]
        advice = f"give scans.columns={' or '.join(fitting)}" if fitting else "the file is cut off: copy it again"
        raise DataError(
            f"{path}: expected a multiple of {row} bytes ({columns} float32 a point), found {size}; {advice}"
        )


def _read_bin(path: Path, columns: int) -> Num[np.ndarray, "points columns"]:
    """Read rows of float32."""
    check_size(path, columns)
    return np.frombuffer(path.read_bytes(), FLOAT).reshape(-1, columns)


def _read_npy(path: Path) -> Num[np.ndarray, "points columns"]:
    """Read an array with a row for each point."""
    try:
        array = np.load(path, allow_pickle=False)
    except Exception as error:  # a foreign header is parsed as Python, and fails in all of its ways
        raise DataError(f"{path}: expected an .npy array of numbers, found none readable ({error})") from error
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
        found = array.dtype if isinstance(array, np.ndarray) else "an archive"
        raise DataError(f"{path}: expected an .npy array of numbers, found {found}")
    if array.ndim != 2 or array.shape[1] < 3:
        raise DataError(f"{path}: expected a row x, y, z (and intensity) for each point, found shape {array.shape}")
    return array[:, :4]


def _read_ply(path: Path) -> Num[np.ndarray, "points columns"]:
    """Read the vertices of a PLY file."""
    with path.open("rb") as file:
        count, fields = _parse(path, "PLY", file, _vertices)
    return _columns(path, fields, count) if count else np.zeros((0, 4), np.float32)


def _vertices(file: IO[bytes]) -> tuple[int, dict[str, np.ndarray]]:
    """How many there are, and the fields of the raw element, which trimesh hands on beside the mesh it would make."""
    vertex: Mapping = load_ply(file, fix_texture=False, skip_materials=True)["metadata"]["_ply_raw"]["vertex"]
    fields = vertex.get("data", {})
    names = fields.dtype.names if isinstance(fields, np.ndarray) else fields
    return vertex["length"], {name: np.asarray(fields[name]) for name in names}


def _read_pcd(path: Path) -> Num[np.ndarray, "points columns"]:
    """Read a PCD file; one that ends early is refused, since the library would return fewer points."""
    try:
        from pypcd4 import PointCloud
    except ImportError as error:
        raise ConfigError(f"{path}: reading .pcd files takes an extra: pip install 'most-lidar[pcd]'") from error
    with path.open("rb") as file:
        cloud = _parse(path, "PCD", file, PointCloud.from_fileobj)
    rows = cloud.pc_data  # a record, not an array of one, where an ASCII file has a single point
    return _columns(path, {name: rows[name] for name in rows.dtype.names or ()}, cloud.metadata.points)


def _parse(path: Path, kind: str, file: IO[bytes], parse: Callable) -> Any:
    """Let a library read a file; whatever it stumbles over is the file's fault."""
    try:
        return parse(file)
    except Exception as error:
        raise DataError(
            f"{path}: expected a {kind} file of points, found none readable ({type(error).__name__}: {error}); "
            "it is cut off or of another kind"
        ) from error


def _columns(path: Path, fields: Mapping[str, np.ndarray], count: int) -> Num[np.ndarray, "points columns"]:
    """Lay the named fields of a file side by side: x, y, z and, where there is one, the intensity."""
    named = {name.lower(): np.asarray(values).reshape(-1) for name, values in fields.items()}
    if missing := [axis for axis in "xyz" if axis not in named]:
        raise DataError(f"{path}: expected fields x, y and z, found no {', '.join(missing)} in {', '.join(named)}")
    chosen = [*"xyz", *[name for name in INTENSITY if name in named][:1]]
    if others := [name for name in chosen if named[name].dtype.kind not in "fiu"]:
        raise DataError(
            f"{path}: expected numbers in {', '.join(chosen)}, found others in {others[0]}; the file is cut off or "
            "damaged: copy it again"
        )
    if short := [name for name in chosen if len(named[name]) != count]:
        raise DataError(
            f"{path}: expected the {count} points that its header tells of, found {len(named[short[0]])}; "
            "the file is cut off: copy it again"
        )
    return np.stack([named[name] for name in chosen], 1)


READERS = {".npy": _read_npy, ".pcd": _read_pcd, ".ply": _read_ply}
SUFFIXES = (".bin", *READERS)
