"""Scores a folder of predictions in the official layout, ours or anyone's, one scan at a time."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jaxtyping import Float, Int64
from torch import Tensor
from tqdm import tqdm

from most.datasets.reader import Frame, Reader
from most.datasets.taxonomy import Taxonomy
from most.errors import DataError, check_entries
from most.metrics.assignments import assignments_path, read_assignments
from most.metrics.instances import find_instances
from most.metrics.membership import MembershipCounts, membership_counts
from most.metrics.sequences import LabelScores


def evaluate_folder(reader: Reader, frames: Sequence[Frame], folder: Path, progress: bool = True) -> dict[str, Any]:
    """Score the predictions of ``frames``, in the order of time, in ``folder`` and return the report.

    ``{"scans": ..., "panoptic": {pq, ..., membership_accuracy, membership_accuracy_contested, per_class, sums}}``, with
    ``lstq`` or ``tracking`` beside, see :class:`SequenceScores`; ``sums`` as :mod:`most.metrics.split_sums` has it.
    The membership accuracies are None unless the folder also holds detections and the dataset its scans. Raises
    DataError for predictions that are missing or do not fit the truth, and for a split without labels.
    """
    paths = prediction_paths(reader, frames, folder)
    scores = _Scores(reader, _has_assignments(reader, frames, paths))
    for frame, path in tqdm(
        zip(frames, paths, strict=True), "evaluate", len(frames), unit="scan", disable=not progress
    ):
        scores.add(frame, path)
    return {"scans": len(frames)} | scores.report()


class _Scores:
    """All figures of a folder, summed over its scans."""

    def __init__(self, reader: Reader, with_memberships: bool) -> None:
        self.reader, self.taxonomy = reader, reader.taxonomy
        self.with_memberships = with_memberships
        self.labels = LabelScores(self.taxonomy)

    def add(self, frame: Frame, path: Path) -> None:
        """Score one scan's prediction."""
        truth, labels = self.reader.labels(frame), self.reader.read_prediction(path)
        check_fit(self.reader, frame, path, labels, truth)
        known = self.taxonomy.to_training(truth, "truth of " + str(path))
        semantics = self.taxonomy.decode(labels, path)
        points, memberships = self._points(frame), None
        if points is not None and self.with_memberships:
            memberships = _memberships(assignments_path(path), points, semantics, truth, known, self.taxonomy)
        self.labels.update(frame.sequence, semantics, labels, known, truth, points, memberships)

    def _points(self, frame: Frame) -> Float[Tensor, "points 3"] | None:
        """Read where the points are, if the scan is there; memberships cannot do without."""
        try:
            return self.reader.sweep(frame).points[:, :3]
        except DataError:
            if self.with_memberships:
                raise
            return None

    def report(self) -> dict[str, Any]:
        """Return all sections."""
        report = self.labels.report()
        report["panoptic"]["sums"] = self.labels.plain_sums()
        return report


def prediction_paths(reader: Reader, frames: Sequence[Frame], folder: Path) -> list[Path]:
    """Where the predictions lie; raises DataError unless all are there."""
    if not frames:
        raise DataError(f"{folder}: expected predictions of scans, found no scan in the split")
    paths = [reader.prediction_path(folder, frame) for frame in frames]
    if missing := [path for path in paths if not path.is_file()]:
        raise DataError(
            f"{missing[0]}: expected a prediction for each of {len(paths)} scans, found none for {len(missing)}, "
            "of which this is the first; check the folder and the split, or predict them"
        )
    return paths


def check_fit(
    reader: Reader, frame: Frame, path: Path, labels: Int64[Tensor, "labels"], truth: Int64[Tensor, "points"]
) -> None:
    """Refuse a prediction read from ``path`` that is no labelling of the truth's points.

    Where the scan is there, which scoring does not need, it decides whether the truth's own file is at fault.
    """
    if len(labels) == len(truth):
        return
    try:
        points = reader.num_points(frame)
    except DataError:
        points = len(truth)
    if points != len(truth):
        reader.sweep(frame)  # a DataError about the file of the truth
    check_entries(path, len(labels), len(truth), whose="truth")


def _has_assignments(reader: Reader, frames: Sequence[Frame], paths: Sequence[Path]) -> bool:
    """Whether everything is there that the membership accuracy needs; says so where only a part is."""
    there = sum(assignments_path(path).is_file() for path in paths)
    if not there:
        return False
    if there < len(paths):
        warnings.warn(f"no membership accuracy: detections of {there} of {len(paths)} scans are there", stacklevel=3)
        return False
    try:
        reader.sweep(frames[0])
    except DataError as error:
        warnings.warn(f"no membership accuracy: {error}", stacklevel=3)
        return False
    return True


def _memberships(
    path: Path,
    points: Float[Tensor, "points 3"],
    semantics: Int64[Tensor, "points"],
    truth: Int64[Tensor, "points"],
    truth_semantics: Int64[Tensor, "points"],
    taxonomy: Taxonomy,
) -> MembershipCounts:
    """Score the memberships of one scan, written to ``path``."""
    found = read_assignments(path, taxonomy.num_classes)
    check_entries(path, len(found.assigned), len(points), "an entry")
    instances = find_instances(points, truth, truth_semantics, taxonomy)
    return membership_counts(
        points, semantics, truth_semantics, truth, found.detections, found.roi, found.assigned, instances
    )
