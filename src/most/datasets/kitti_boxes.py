"""``boxes.npz`` beside a simulated sequence in SemanticKITTI's layout: amodal boxes, which the dataset itself lacks."""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float64
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.errors import DataError
from most.files import NO_ARCHIVE
from most.geometry.poses import invert, yaw
from most.modal.boxes import SequenceBoxes

WIDTHS = {"scan": (), "instance": (), "label": (), "centre": (3,), "half_size": (3,), "yaw": ()}
INTEGERS = ("scan", "instance", "label")
_REMEDY = "simulate the sequence again"


def read_boxes(path: Path, poses: Float64[Tensor, "scans 4 4"], taxonomy: Taxonomy) -> SequenceBoxes:
    """Read a sequence's boxes (world frame) into the frames of its sensor, which is at ``poses``."""
    arrays = _arrays(path)
    scans, instances, labels = (torch.from_numpy(arrays[name].astype(np.int64)) for name in INTEGERS)
    if len(scans) and not 0 <= int(scans.min()) <= int(scans.max()) < len(poses):
        raise DataError(f"{path}: scan: expected numbers in 0..{len(poses) - 1}, found others; {_REMEDY}")
    keys = taxonomy.label.join(labels, instances)
    upright = torch.eye(4, dtype=torch.float64).repeat(len(scans), 1, 1)
    angles = torch.from_numpy(arrays["yaw"].astype(np.float64))
    upright[:, 0, 0] = upright[:, 1, 1] = angles.cos()
    upright[:, 1, 0], upright[:, 0, 1] = angles.sin(), -angles.sin()
    upright[:, :3, 3] = torch.from_numpy(arrays["centre"].astype(np.float64))
    boxes = invert(poses[scans]) @ upright
    return SequenceBoxes(
        frames=scans,
        objects=torch.unique(keys, return_inverse=True)[1],
        classes=taxonomy.to_training(keys, path),
        keys=keys,
        centres=boxes[:, :3, 3],
        half_sizes=torch.from_numpy(arrays["half_size"].astype(np.float64)),
        yaws=yaw(boxes),
    )


def _arrays(path: Path) -> dict[str, np.ndarray]:
    """Return the file's arrays; a DataError for one that is missing or no table of finite numbers."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in WIDTHS}
    except NO_ARCHIVE as error:
        raise DataError(f"{path}: expected the arrays {', '.join(WIDTHS)}, found none ({error}); {_REMEDY}") from error
    for name, width in WIDTHS.items():
        kinds = "iu" if name in INTEGERS else "f"
        if arrays[name].shape != (arrays["scan"].size, *width) or arrays[name].dtype.kind not in kinds:
            raise DataError(
                f"{path}: {name}: expected {'integers' if kinds == 'iu' else 'numbers'}, {width or 1} a box, found "
                f"{arrays[name].dtype} of shape {arrays[name].shape}; {_REMEDY}"
            )
        if not np.isfinite(arrays[name]).all():
            raise DataError(f"{path}: {name}: expected finite numbers, found others; {_REMEDY}")
    return arrays
