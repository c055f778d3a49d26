"""Writing predictions: the official label files, and the detections beside them."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

import torch
from tqdm import tqdm

from most.claims import claim
from most.datasets.reader import Frame, Reader
from most.inference import Prediction, Predictor
from most.metrics.assignments import Assignments, assignments_path, read_assignments, write_assignments
from most.structures import Panoptic, Sample

RECORD = "prediction.json"


def claim_folder(out: Path, checkpoint: Path, reader: Reader, split: str, membership: str) -> None:
    """Note in ``out`` what is written there; another model's or dataset's are not mixed in, the same one's go on."""
    content = {
        "checkpoint_sha256": hashlib.sha256(checkpoint.read_bytes()).hexdigest(),
        "dataset": str(reader.place.resolve()),
        "split": split,
        "membership": membership,
        "sequences": reader.sequences(split),
    }
    claim(out, RECORD, content, "predictions of another checkpoint, membership, dataset or split")


def unfinished(reader: Reader, frames: list[Frame], out: Path) -> list[Frame]:
    """Return the frames that have no prediction yet."""
    return [frame for frame in frames if not reader.prediction_path(out, frame).is_file()]


@torch.inference_mode()
def write_predictions(
    predictor: Predictor, batches: Iterable[list[Sample]], reader: Reader, out: Path, total: int, device: torch.device
) -> None:
    """Label ``total`` sweeps and write each when it is done."""
    for module in predictor.modules().values():
        module.eval().to(device)
    with tqdm(total=total, desc="predict", unit="sweep") as progress:
        for samples in batches:
            moved = [sample.to(device) for sample in samples]
            for sample, prediction in zip(samples, predictor(moved), strict=True):
                path = reader.prediction_path(out, Frame(sample.sequence, sample.index))
                write_prediction(prediction.to("cpu"), reader, path)
                progress.update()


def read_prediction(reader: Reader, path: Path) -> Prediction:
    """Read back what ``write_prediction`` wrote; DataError where it is not there."""
    labels, found = reader.read_prediction(path), read_assignments(assignments_path(path))
    panoptic = Panoptic(reader.taxonomy.decode(labels, path), reader.taxonomy.instance_of(labels))
    return Prediction(panoptic, found.detections, found.roi, found.assigned)


def write_prediction(prediction: Prediction, reader: Reader, path: Path) -> None:
    """Write one sweep's detections, then its labels: where labels are, all is."""
    found = Assignments(prediction.detections, prediction.roi, prediction.claimed)
    write_assignments(assignments_path(path), found)
    reader.write_prediction(path, reader.taxonomy.encode(prediction.panoptic.semantics, prediction.panoptic.ids))
