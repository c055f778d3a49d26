"""Writing predictions: the official label files, and the detections beside them."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import Any

from jaxtyping import Int64
from torch import Tensor
from tqdm import tqdm

from most.assembly import check_taxonomy
from most.claims import claim
from most.config import to_plain
from most.datasets.reader import Frame, Reader
from most.datasets.taxonomy import Taxonomy
from most.datasets.window_stream import WindowStream
from most.datasets.windows import Window
from most.errors import named
from most.inference import Prediction
from most.metrics.assignments import Assignments, assignments_path, read_assignments, write_assignments
from most.streaming import PanopticTracker
from most.structures import Panoptic
from most.tracking import TrackerSettings

RECORD = "prediction.json"


def predict_split(
    model: PanopticTracker, described: Mapping[str, Any], reader: Reader, split: str, out: Path, ahead: bool
) -> None:
    """Write a dataset's official prediction files of a split to ``out``, and go on where that was interrupted.

    ``described`` as by :func:`describe_model`; ``ahead``: sweeps are read in a process of their own.
    """
    check_taxonomy(model.taxonomy, reader.taxonomy)
    frames = reader.frames(split)
    claim_folder(out, described, describe_split(reader, split))
    frames = unfinished(reader, frames, out)
    windows = WindowStream(reader, frames, model.previous).load(ahead)
    write_predictions(model, windows, reader, out, len(frames))


def claim_folder(out: Path, model: Mapping[str, Any], scans: Mapping[str, Any]) -> None:
    """Note in ``out`` whose predictions of which scans are written there; others are not mixed in."""
    claim(out, RECORD, {**model, **scans}, "predictions of another checkpoint, membership, tracker or of other scans")


def describe_model(checkpoint: Path, membership: Any, tracker: TrackerSettings) -> dict[str, Any]:
    """Return what predictions depend on besides the scans, in plain types; ``membership`` None is the checkpoint's."""
    return {
        "checkpoint_sha256": hashlib.sha256(checkpoint.read_bytes()).hexdigest(),
        "membership": "trained" if membership is None else to_plain("membership", membership),
        "tracker": asdict(tracker),
    }


def describe_split(reader: Reader, split: str) -> dict[str, Any]:
    """Return which scans a split has, in plain types."""
    return {"dataset": str(reader.place.resolve()), "split": split, "sequences": reader.sequences(split)}


def unfinished(reader: Reader, frames: list[Frame], out: Path) -> list[Frame]:
    """Return the frames of the sequences of which a prediction is missing: tracks need all of a sequence."""
    missing = {frame.sequence for frame in frames if not reader.prediction_path(out, frame).is_file()}
    return [frame for frame in frames if frame.sequence in missing]


def write_predictions(model: PanopticTracker, windows: Iterable[Window], reader: Reader, out: Path, total: int) -> None:
    """Label ``total`` sweeps, each sequence from its beginning, and write each when it is done.

    What is written already is taken in as it is: a run that goes on writes what it would have written.
    """
    with tqdm(windows, "predict", total, unit="sweep") as progress:
        for name, sequence in groupby(progress, key=lambda window: window.sweep.sequence):
            model.begin()
            for window in sequence:
                path = reader.prediction_path(out, Frame(name, window.sweep.index))
                said = read_prediction(reader, path) if path.is_file() else None
                with named(path):
                    if said is None:
                        write_prediction(model.see(window).prediction, reader, path)
                    else:
                        model.follow(window.sweep, said)


def read_prediction(reader: Reader, path: Path) -> Prediction:
    """Read back what ``write_prediction`` wrote; DataError where it is not there."""
    return join_prediction(reader.taxonomy, reader.read_prediction(path), path)


def write_prediction(prediction: Prediction, reader: Reader, path: Path) -> None:
    """Write one sweep's detections, then its labels: where labels are, all is."""
    write_assignments(assignments_path(path), assignments_of(prediction))
    reader.write_prediction(path, encode(reader.taxonomy, prediction))


def join_prediction(taxonomy: Taxonomy, labels: Int64[Tensor, "points"], path: Path) -> Prediction:
    """Return the prediction whose labels were read from ``path``, with the detections that lie beside them."""
    found = read_assignments(assignments_path(path))
    panoptic = Panoptic(taxonomy.decode(labels, path), taxonomy.instance_of(labels))
    return Prediction(panoptic, found.detections, found.roi, found.assigned)


def assignments_of(prediction: Prediction) -> Assignments:
    """Return what is kept beside the labels."""
    return Assignments(prediction.detections, prediction.roi, prediction.claimed)


def encode(taxonomy: Taxonomy, prediction: Prediction) -> Int64[Tensor, "points"]:
    """Return the labels of a prediction as a submission has them."""
    return taxonomy.encode(prediction.panoptic.semantics, prediction.panoptic.ids)
