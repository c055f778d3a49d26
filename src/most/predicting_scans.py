"""Writing predictions of scans that belong to no dataset."""

import hashlib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from tqdm import tqdm

from most.datasets.labels import read_labels, write_labels
from most.datasets.scan_folder import Scan, ScanFolder
from most.errors import named
from most.metrics.assignments import assignments_path, write_assignments
from most.predicting import assignments_of, claim_folder, encode, join_prediction
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
    """Label one scan after the other: ``out/predictions/NAME.label``, a uint32 a point, and detections beside them.

    What is labelled already is taken in as it is: a run that goes on writes what it would have written.
    """
    model.begin()
    for scan in tqdm(scans, "predict", unit="scan"):
        path = out / "predictions" / f"{scan.name}.label"
        with named(path):
            _label(model, scan, path)


def _label(model: PanopticTracker, scan: Scan, path: Path) -> None:
    taxonomy = model.taxonomy
    if path.is_file():
        model.recall(join_prediction(taxonomy, read_labels(path), path), scan.points, scan.pose, scan.time)
        return
    said = model.step(scan.points, scan.pose, scan.time).prediction
    write_assignments(assignments_path(path), assignments_of(said))
    write_labels(path, encode(taxonomy, said))
