"""The official evaluators' golden cases in tests/goldens: labels of a few scans, and the figures that they print."""

import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

FOLDER = Path(__file__).parent / "goldens"


def golden_paths(*parts: str) -> list[Path]:
    """The figures' files in some of the folders."""
    return sorted(path for part in parts for path in (FOLDER / part).glob("*.json"))


def name_of(path: Path) -> str:
    return f"{path.parent.name}/{path.stem}"


@dataclass
class GoldenScan:
    """``labels`` and ``ids`` are (predicted classes, predicted keys, true classes, true keys), as metrics take them."""

    sequence: int
    labels: tuple[Tensor, ...]  # keys are whole raw labels
    ids: tuple[Tensor, ...]  # keys are instance ids: SemanticKITTI's label >> 16, nuScenes' whole label


@dataclass
class GoldenCase:
    min_points: int
    expected: dict[str, Any]
    scans: list[GoldenScan]


def read_golden(path: Path) -> GoldenCase:
    figures = json.loads(path.read_text())
    with np.load(path.with_suffix(".npz"), allow_pickle=False) as arrays:
        bounds, sequences = arrays["frame_offsets"].tolist(), arrays["frame_scene"].tolist()
        columns = {
            name: torch.from_numpy(arrays[name].astype(np.int64))
            for name in ("pred_sem", "pred_label", "pred_inst", "gt_sem", "gt_label", "gt_inst")
        }
    scans = []
    for sequence, (first, last) in zip(sequences, pairwise(bounds), strict=True):
        part = {name: column[first:last] for name, column in columns.items()}
        labels, ids = (
            (part["pred_sem"], part[f"pred_{key}"], part["gt_sem"], part[f"gt_{key}"]) for key in ("label", "inst")
        )
        scans.append(GoldenScan(sequence, labels, ids))
    return GoldenCase(figures["min_points"], figures["expected"], scans)
