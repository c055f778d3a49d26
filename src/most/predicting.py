"""Writing the predictions of a dataset's split: the official label files, and the detections beside them."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from tqdm import tqdm

from most.assembly import check_taxonomy
from most.claims import claim
from most.config import COMPONENTS, to_plain
from most.datasets.reader import Frame, Reader
from most.datasets.window_stream import WindowStream
from most.datasets.windows import Window
from most.inference import Prediction
from most.predictions import say_once
from most.streaming import PanopticTracker
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


def predicted_by(folder: Path) -> dict[str, Any]:
    """Return what a report on a folder of predictions says of their making; nothing where they do not tell.

    ``{"prediction": {checkpoint_sha256, membership, changed}}``: the membership's name, or "trained", and the settings
    of it and of the tracker that are not the defaults, as ``tracker.motion=kalman``.
    """
    try:
        record = json.loads((folder / RECORD).read_text())
        membership, tracker = record["membership"], _changed("tracker", "tracker", record["tracker"])
        name = membership if membership == "trained" else membership["component"]
        own = [] if membership == "trained" else _changed("membership", name, membership["settings"])
        made = {"checkpoint_sha256": record["checkpoint_sha256"], "membership": name, "changed": own + tracker}
    except (OSError, ValueError, LookupError, TypeError):
        return {}  # others' predictions, or of an earlier version
    return {"prediction": made}


def _changed(group: str, name: str, settings: Mapping[str, Any]) -> list[str]:
    usual = asdict(COMPONENTS[group][name]())
    return [f"{group}.{key}={value}" for key, value in settings.items() if usual.get(key) != value]


def describe_split(reader: Reader, split: str) -> dict[str, Any]:
    """Return which scans a split has, in plain types."""
    return {"dataset": str(reader.place.resolve()), "split": split, "sequences": reader.sequences(split)}


def unfinished(reader: Reader, frames: list[Frame], out: Path) -> list[Frame]:
    """Return the frames of the sequences of which a prediction is missing: tracks need all of a sequence."""
    missing = {frame.sequence for frame in frames if not reader.prediction_path(out, frame).is_file()}
    return [frame for frame in frames if frame.sequence in missing]


def write_predictions(model: PanopticTracker, windows: Iterable[Window], reader: Reader, out: Path, total: int) -> None:
    """Label ``total`` sweeps, each sequence from its beginning, and write each when it is done; see ``say_once``."""
    with tqdm(windows, "predict", total, unit="sweep") as progress:
        for name, sequence in groupby(progress, key=lambda window: window.sweep.sequence):
            model.begin()
            for window in sequence:
                path = reader.prediction_path(out, Frame(name, window.sweep.index))
                say_once(reader, path, partial(_say, model, window), partial(model.follow, window.sweep))


def _say(model: PanopticTracker, window: Window) -> Prediction:
    return model.see(window).prediction
