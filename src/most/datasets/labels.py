"""SemanticKITTI's ``.label`` files: one little-endian uint32 a point, in the order of the scan."""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Int64
from torch import Tensor

from most.errors import DataError
from most.files import atomic_write

LABEL = np.dtype("<u4")


def read_labels(path: Path) -> Int64[Tensor, "points"]:
    """Read raw labels, widened to int64; a DataError tells a missing file or one cut off within a label."""
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path}: expected a label file, found none; check the folder, or predict first")
    content = path.read_bytes()
    if len(content) % LABEL.itemsize:
        raise DataError(
            f"{path}: expected a multiple of {LABEL.itemsize} bytes (uint32 a point), found {len(content)}; "
            "the file is cut off or no label file: copy it again"
        )
    return torch.from_numpy(np.frombuffer(content, LABEL).astype(np.int64))


def write_labels(path: Path, raw: Int64[Tensor, "points"]) -> None:
    """Write raw labels atomically; they must fit an unsigned 32-bit integer."""
    if raw.numel() and not 0 <= int(raw.min()) <= int(raw.max()) < 1 << 32:
        raise DataError(f"{path}: expected labels in 0..2^32 - 1, found {int(raw.min())}..{int(raw.max())}")
    with atomic_write(Path(path)) as file:
        file.write(raw.cpu().numpy().astype(LABEL).tobytes())
