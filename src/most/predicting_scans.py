"""Writing predictions of scans that belong to no dataset."""

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Int64
from torch import Tensor
from tqdm import tqdm

from most.datasets.labels import read_labels, write_labels
from most.datasets.scan_folder import Scan, ScanFolder
from most.datasets.taxonomy import Taxonomy
from most.inference import Prediction
from most.predicting import claim_folder
from most.predictions import say_once
from most.streaming import PanopticTracker


def predict_scans(model: PanopticTracker, described: Mapping[str, Any], scans: ScanFolder, out: Path) -> None:
    """Label scans in ``out``, and go on where that was interrupted; ``described`` as by ``describe_model``."""
    claim_folder(out, described, describe_scans(scans))
    label_scans(model, scans, out)


def describe_scans(scans: ScanFolder) -> dict[str, Any]:
    """Return which scans there are and how they are read, in plain types."""
    names = [path.name for path in scans.paths]
    where = torch.zeros(0) if scans.poses is None else scans.poses
    travel = hashlib.sha256(where.numpy().tobytes() + scans.times.numpy().tobytes()).hexdigest()
    settings = {key: value for key, value in asdict(scans.settings).items() if key not in ("poses", "times")}
    return {"input": str(scans.folder.resolve()), "scans": names, "read": settings, "poses_and_times_sha256": travel}


def label_scans(model: PanopticTracker, scans: ScanFolder, out: Path) -> None:
    """Label one scan after the other: ``out/predictions/NAME.label``, and detections beside them; see ``say_once``."""
    model.begin()
    for scan in tqdm(scans, "predict", unit="scan"):
        path = out / "predictions" / f"{scan.name}.label"
        say_once(ScanLabels(model.taxonomy), path, partial(_say, model, scan), partial(_take_in, model, scan))


@dataclass
class ScanLabels:
    """Label files of scans that belong to no dataset: a uint32 a point, as the model's own dataset encodes them."""

    taxonomy: Taxonomy

    def read_prediction(self, path: Path) -> Int64[Tensor, "points"]:
        """Read the labels of a scan."""
        return read_labels(path)

    def write_prediction(self, path: Path, labels: Int64[Tensor, "points"]) -> None:
        """Write the labels of a scan."""
        write_labels(path, labels)


def _say(model: PanopticTracker, scan: Scan) -> Prediction:
    return model.step(scan.points, scan.pose, scan.time).prediction


def _take_in(model: PanopticTracker, scan: Scan, said: Prediction) -> None:
    model.recall(said, scan.points, scan.pose, scan.time)
