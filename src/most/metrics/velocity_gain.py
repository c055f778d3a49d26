"""What predicted velocities are worth: two trackings of the same predictions, with them and without."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Int64
from torch import Tensor
from tqdm import tqdm

from most.datasets.dataset import InstanceLookup
from most.datasets.reader import Frame, Reader
from most.datasets.taxonomy import Taxonomy
from most.errors import DataError
from most.geometry.similarity import Similarity
from most.metrics.assignments import assignments_path, read_assignments
from most.metrics.folders import check_fit, prediction_paths
from most.metrics.links import Links
from most.metrics.overlaps import find_overlaps
from most.metrics.paired import paired_difference
from most.metrics.sequences import SequenceScores
from most.metrics.tracking import Track, thing_matches
from most.metrics.velocities import VelocityErrors, is_moving, velocity_errors
from most.structures import Instances


def velocity_gain(
    reader: Reader, frames: Sequence[Frame], instances: InstanceLookup, velocity: Path, nearest: Path
) -> dict[str, Any]:
    """Compare two folders that ``most.track`` wrote of the same predictions; frames are in the order of time.

    ``{"scans", "sequences": {name: {velocity, nearest}}, "lstq": {velocity, nearest, difference, low, high}, "links":
    {all, moving: {velocity, nearest: {kept, switched}}}, "velocity_error": {objects, predicted, zero, per_class}}``:
    LSTQ of each sequence by itself, its mean, and the mean difference with its paired 95 % interval, fractions; errors
    in m/s. PQ and all else that knows no identities is the same for both. Raises DataError where the predictions are
    not the same, where they have no detections beside them, and for less than two sequences.
    """
    folders = {"velocity": velocity, "nearest": nearest}
    for folder in folders.values():
        prediction_paths(reader, frames, folder)
    ways: dict[str, list[_Way]] = {name: [] for name in folders}
    errors = []
    with tqdm(frames, "compare", unit="scan") as progress:
        for _, sequence in groupby(progress, key=lambda frame: frame.sequence):
            for name in ways:
                ways[name].append(_Way(reader.taxonomy))
            for frame in sequence:
                truth = instances(frame, Similarity.identity())
                errors.append(_errors(reader, frame, truth, velocity))
                _count(reader, frame, truth, folders, {name: way[-1] for name, way in ways.items()})
    names = list(dict.fromkeys(frame.sequence for frame in frames))
    lstq = {name: [each.lstq() for each in way] for name, way in ways.items()}
    return {
        "scans": len(frames),
        "sequences": {name: {way: lstq[way][row] for way in lstq} for row, name in enumerate(names)},
        "lstq": mean_gain(lstq["velocity"], lstq["nearest"]),
        "links": {kind: {name: _links(way, kind) for name, way in ways.items()} for kind in ("all", "moving")},
        "velocity_error": _by_class(VelocityErrors.cat(errors), reader.taxonomy),
    }


@dataclass
class _Way:
    """One tracking of one sequence, and what is counted of it."""

    taxonomy: Taxonomy
    links: dict[str, Links] = field(default_factory=lambda: {"all": Links(), "moving": Links()})
    found: dict[Track, int] = field(default_factory=dict)  # the identity of each object in the last scan

    def __post_init__(self) -> None:
        self.scores = SequenceScores(self.taxonomy)

    def add(
        self, labels: Int64[Tensor, "points"], truth: Int64[Tensor, "points"], moving: set[Track], source: Path
    ) -> None:
        """Count the next scan; labels are whole, ``moving`` the objects that move."""
        semantics, known = self.taxonomy.decode(labels, source), self.taxonomy.to_training(truth, "truth")
        self.scores.update("", semantics, labels, known, truth)
        matches = thing_matches(find_overlaps(semantics, labels, known, truth).known, self.taxonomy.things)
        now = {track: key for track, (key, _) in matches.items()}
        self.links["all"] += Links.between(self.found, now)
        self.links["moving"] += Links.between(self.found, {track: key for track, key in now.items() if track in moving})
        self.found = now

    def lstq(self) -> float:
        """LSTQ of the sequence."""
        return self.scores.lstq.compute()["lstq"]


def _count(reader: Reader, frame: Frame, truth: Instances, folders: dict[str, Path], ways: dict[str, _Way]) -> None:
    """Add a scan to both trackings; a DataError unless they differ in identities alone."""
    paths = {name: reader.prediction_path(folder, frame) for name, folder in folders.items()}
    labels = {name: reader.read_prediction(path) for name, path in paths.items()}
    raw, moves = reader.labels(frame), is_moving(truth)
    for name, path in paths.items():
        check_fit(reader, frame, path, labels[name], raw)
    if not _same_segments(*labels.values()):
        raise DataError(
            f"{paths['nearest']}: expected the segments of {paths['velocity']}, found others; "
            "track the same predictions in both ways"
        )
    moving = set(zip(truth.classes[moves].tolist(), truth.keys[moves].tolist(), strict=True))
    for name, way in ways.items():
        way.add(labels[name], raw, moving, paths[name])


def _same_segments(one: Int64[Tensor, "points"], other: Int64[Tensor, "points"]) -> bool:
    """Whether two labellings of a scan tell the same points apart."""
    pairs = torch.stack([one, other]).unique(dim=1)
    return pairs.shape[1] == len(one.unique()) == len(other.unique())


def _errors(reader: Reader, frame: Frame, truth: Instances, folder: Path) -> VelocityErrors:
    beside = assignments_path(reader.prediction_path(folder, frame))
    found = read_assignments(beside, reader.taxonomy.num_classes)
    return velocity_errors(found.detections, found.roi, truth)


def _links(sequences: Sequence[_Way], kind: str) -> dict[str, int]:
    """Sum up links over the sequences of a tracking."""
    return asdict(sum((each.links[kind] for each in sequences), Links()))


def mean_gain(velocity: list[float], nearest: list[float]) -> dict[str, float | None]:
    """Return means, difference and interval over the sequences that have an LSTQ: one without things has none (NaN)."""
    ways = np.array([velocity, nearest])
    ways = ways[:, np.isfinite(ways).all(0)]
    gain = paired_difference(*ways.tolist())
    means = dict(zip(("velocity", "nearest"), ways.mean(1).tolist(), strict=True))
    return means | {"difference": gain.value, "low": gain.low, "high": gain.high}


def _by_class(errors: VelocityErrors, taxonomy: Taxonomy) -> dict[str, Any]:
    """Mean errors over all objects, and by class."""
    classes = {taxonomy.class_names[thing]: errors.select(errors.classes == thing) for thing in taxonomy.things}
    return errors.summary() | {"per_class": {name: found.summary() for name, found in classes.items() if len(found)}}
