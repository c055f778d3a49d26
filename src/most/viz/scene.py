"""A predicted sequence beside its truth, written as a recording. Needs the extra ``viz``."""

import warnings
from collections.abc import Iterator
from pathlib import Path

from tqdm import tqdm

from most.datasets.reader import Frame, Reader
from most.errors import DataError, check_entries
from most.structures import Panoptic, Sweep
from most.viz.agreement import compare, segments
from most.viz.classes import ClassStyle
from most.viz.identities import Identities
from most.viz.objects import predicted_objects, table_objects, true_table
from most.viz.recording import Recording

PREDICTION, TRUTH = "prediction", "truth"


def predicted_frames(reader: Reader, sequence: str, folder: Path, first: int, last: int | None) -> list[Frame]:
    """The key frames from number ``first`` to ``last`` that ``folder`` has predictions of; a DataError for none."""
    end = float("inf") if last is None else last
    frames = [frame for frame in reader.key_frames(sequence) if first <= frame.index <= end]
    there = [frame for frame in frames if reader.prediction_path(folder, frame).is_file()]
    if not there:
        wanted = reader.prediction_path(folder, frames[0]) if frames else f"{folder}: sequence {sequence}"
        raise DataError(
            f"{wanted}: expected predictions of scans {first} to {'the last' if last is None else last}, found none of "
            f"{len(frames)}; check the folder, the sequence and the range, or predict them"
        )
    if len(there) < len(frames):
        warnings.warn(f"{folder}: {len(frames) - len(there)} of {len(frames)} scans have no prediction", stacklevel=2)
    return there


def write_scene(path: Path, reader: Reader, frames: list[Frame], folder: Path) -> None:
    """Write the predictions of ``frames``, which follow one another in one sequence, to a recording at ``path``."""
    sequence = frames[0].sequence
    trees = [PREDICTION, TRUTH] if reader.has_labels(sequence) else [PREDICTION]
    taxonomy = reader.taxonomy
    style = ClassStyle(taxonomy.class_names, taxonomy.colours, taxonomy.things)
    recording = Recording(path, f"sequence {sequence}", style, trees)
    try:
        _Scene(recording, reader, folder).write(frames)
    finally:
        recording.close()
    recording.check_whole()


class _Scene:
    """The state of a recording in the making."""

    def __init__(self, recording: Recording, reader: Reader, folder: Path) -> None:
        self.recording, self.reader, self.folder = recording, reader, folder
        self.truth, self.prediction = Identities(1), Identities(-1)
        self.seconds: dict[int, float] = {}  # of each scan since the first one shown

    def write(self, frames: list[Frame]) -> None:
        """Write all points and predicted objects; the truth's objects last, as their motion needs their neighbours."""
        table = true_table(self._show_points(frames), self.reader)  # reads the scans as it goes, and keeps none
        for index in table.frames.tolist():
            self.recording.at(index, self.seconds[index])
            self.recording.objects(TRUTH, table_objects(table, index, lambda raw: raw), self.truth)

    def _show_points(self, frames: list[Frame]) -> Iterator[Sweep]:
        start = None
        for frame in tqdm(frames, "view", unit="scan"):
            sweep = self.reader.sweep(frame)
            start = sweep.time if start is None else start
            self.seconds[frame.index] = sweep.time - start
            self.recording.at(frame.index, self.seconds[frame.index])
            truth = self._show_truth(sweep)
            self._show_prediction(sweep, truth, self.reader.prediction_path(self.folder, frame))
            yield sweep

    def _show_truth(self, sweep: Sweep) -> Panoptic | None:
        if sweep.labels is None:
            return None
        taxonomy = self.reader.taxonomy
        semantics = taxonomy.to_training(sweep.labels, f"truth of scan {sweep.index}")
        has_id = taxonomy.is_thing(semantics) & (taxonomy.instance_of(sweep.labels) != 0)
        truth = Panoptic(semantics, sweep.labels.where(has_id, 0))
        names = segments(truth, taxonomy.things)
        self.truth.meet(names, {})
        self.recording.sensor(TRUTH, sweep.pose)
        self.recording.points(TRUTH, sweep.points[:, :3], truth, names, self.truth)
        return truth

    def _show_prediction(self, sweep: Sweep, truth: Panoptic | None, path: Path) -> None:
        taxonomy, labels = self.reader.taxonomy, self.reader.read_prediction(path)
        check_entries(path, len(labels), len(sweep.points))
        prediction = Panoptic(taxonomy.decode(labels, path), taxonomy.instance_of(labels))
        names = segments(prediction, taxonomy.things)
        partners = compare(truth, prediction, taxonomy.things).partners if truth else {}
        self.prediction.meet(names, {mine: self.truth.numbers[yours] for mine, yours in partners.items()})
        self.recording.sensor(PREDICTION, sweep.pose)
        self.recording.points(PREDICTION, sweep.points[:, :3], prediction, names, self.prediction)
        found = predicted_objects(sweep, labels, names, path, self.reader)
        self.recording.objects(PREDICTION, found, self.prediction)
