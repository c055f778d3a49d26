"""Gives the instances of a folder of predictions, ours or anyone's, identities over time."""

from dataclasses import asdict
from itertools import groupby
from pathlib import Path

from jaxtyping import Int64
from torch import Tensor
from tqdm import tqdm

from most.claims import claim
from most.datasets.reader import Frame, Reader
from most.datasets.taxonomy import Taxonomy
from most.errors import check_entries, named
from most.metrics.assignments import Assignments, assignments_path, read_assignments, write_assignments
from most.metrics.folders import prediction_paths
from most.structures import Panoptic, Sweep
from most.tracking import Segments, Tracker, TrackerSettings, observe

RECORD = "tracks.json"


def new_tracker(settings: TrackerSettings, taxonomy: Taxonomy) -> Tracker:
    """Make the tracker of one sequence, whose numbers labels have room for."""
    return settings.build(taxonomy.gates, taxonomy.label.largest, taxonomy.label.unique_in == "class")


def write_tracks(reader: Reader, split: str, predictions: Path, out: Path, settings: TrackerSettings) -> None:
    """Write the predictions of a split to ``out``, with the numbers of tracks for those of instances.

    Whatever is no thing keeps its label, and detections beside the labels are copied. All scans are gone through
    again after an interruption: what is written is the same.
    """
    frames = reader.frames(split)
    prediction_paths(reader, frames, predictions)
    content = {
        "predictions": str(predictions.resolve()),
        "dataset": str(reader.place.resolve()),
        "split": split,
        "sequences": reader.sequences(split),
        "tracker": asdict(settings),
    }
    claim(out, RECORD, content, "tracks of other predictions, settings, dataset or split")
    with tqdm(frames, "track", unit="sweep") as progress:
        for _, sequence in groupby(progress, key=lambda frame: frame.sequence):
            tracker = new_tracker(settings, reader.taxonomy)
            for frame in sequence:
                _write_frame(reader, frame, predictions, out, tracker)


def _write_frame(reader: Reader, frame: Frame, predictions: Path, out: Path, tracker: Tracker) -> None:
    """Track one scan and write it, detections first: where labels are, all is."""
    source, path = reader.prediction_path(predictions, frame), reader.prediction_path(out, frame)
    sweep, labels = reader.sweep(frame), reader.read_prediction(source)
    beside, num_classes = assignments_path(source), reader.taxonomy.num_classes
    found = read_assignments(beside, num_classes) if beside.is_file() else None
    segments = _observe(reader.taxonomy, sweep, labels, found, source)
    with named(f"{frame.sequence}, scan {frame.index}"):
        identities = tracker.step(segments.observations, sweep.pose, sweep.time)
    if found is not None:
        write_assignments(assignments_path(path), found)
    reader.write_prediction(path, relabel(reader.taxonomy, labels, segments, identities))


def _observe(
    taxonomy: Taxonomy, sweep: Sweep, labels: Int64[Tensor, "labels"], found: Assignments | None, source: Path
) -> Segments:
    """Observe the segments of a prediction; they are told apart by their whole labels, as the benchmarks do."""
    check_entries(source, len(labels), len(sweep.points))
    if found is not None:
        check_entries(assignments_path(source), len(found.assigned), len(labels), "an entry")
    segments = Panoptic(taxonomy.decode(labels, source), labels * (taxonomy.instance_of(labels) != 0))
    beside = (None, None) if found is None else (found.detections, found.assigned)
    return observe(sweep.points[:, :3], segments, taxonomy.things, *beside)


def relabel(
    taxonomy: Taxonomy, labels: Int64[Tensor, "points"], segments: Segments, identities: Int64[Tensor, "segments"]
) -> Int64[Tensor, "points"]:
    """Return labels with the identities of tracks in place of their instances' numbers; all others stay."""
    code = taxonomy.label
    return labels.where(segments.rows < 0, code.join(code.class_of(labels), segments.rename(identities)))
