"""The section ``sums`` of a run's figures as arrays; see :mod:`most.metrics.split_sums` for what it means."""

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import numpy as np
from jaxtyping import Float64

from most.errors import DataError
from most.metrics.sightings import VISIBLE

SEGMENTS = ("tp", "fp", "fn", "iou")
POINTS = ("intersection", "predicted", "true")
TRACKS = ("assoc", "tubes")


@dataclass(frozen=True)
class Measured:
    """On what figures were measured: only what agrees in all of it can be compared."""

    evaluator: str  # whose rules: semantickitti or nuscenes
    classes: tuple[str, ...]  # by training id, void first
    things: tuple[int, ...]
    min_points: int
    sequences: tuple[tuple[str, int], ...]  # and the number of scans of each
    distance_edges: tuple[float, ...]
    points_edges: tuple[float, ...]
    truth: str  # a digest of how many points of each class each sequence has: other scans have others


@dataclass
class Sums:
    """Sums of one run, a row for each held-out sequence."""

    measured: Measured
    counts: Float64[np.ndarray, "sequences 7 classes"]  # SEGMENTS and POINTS
    membership: Float64[np.ndarray, "sequences 4"] | None
    distance: Float64[np.ndarray, "sequences 4 bins"] | None  # SEGMENTS of all things together
    points: Float64[np.ndarray, "sequences 4 sizes"]
    visible: Float64[np.ndarray, "sequences 4 shares"] | None  # None, too, where bins are another version's
    tracks: Float64[np.ndarray, "sequences 2 classes"] | None
    switches: Float64[np.ndarray, "sequences classes"] | None
    tq: Float64[np.ndarray, "sequences 2"] | None  # sum over tracks, and their number


def read_sums(section: Any, where: str) -> Sums:
    """Take a section to arrays; a DataError names what is missing or misshapen ``where``."""
    try:
        points = np.array([each["true"] for each in section["sequences"].values()], np.float64)
        measured = Measured(
            evaluator=str(section["evaluator"]),
            classes=tuple(map(str, section["classes"])),
            things=tuple(map(int, section["things"])),
            min_points=int(section["min_points"]),
            sequences=tuple((str(name), int(each["scans"])) for name, each in section["sequences"].items()),
            distance_edges=tuple(map(float, section["distance_edges"])),
            points_edges=tuple(map(float, section["points_edges"])),
            truth=sha256(points.tobytes()).hexdigest(),
        )
        seen = section.get("visible_edges") == list(VISIBLE)
        return _arrays(measured, list(section["sequences"].values()), seen)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise DataError(
            f"{where}: expected the sums of held-out sequences as this version writes them, found others "
            f"({type(error).__name__}: {error}); score it again with most.evaluate"
        ) from error


def _arrays(measured: Measured, sequences: list[Mapping[str, Any]], seen: bool) -> Sums:
    if not sequences:
        raise ValueError("no sequence")
    size, things = len(measured.classes), list(measured.things)

    def table(names: tuple[str, ...]) -> Any:
        return _shaped([[each[name] for name in names] for each in sequences], (len(sequences), len(names), size))

    def binned(key: str, bins: int) -> Any:
        if any(each[key] is None for each in sequences):
            return None
        rows = [[each[key][name] for name in SEGMENTS] for each in sequences]
        return _shaped(rows, (len(sequences), len(SEGMENTS), bins, size))[..., things].sum(-1)

    def optional(key: str, columns: int) -> Any:
        if any(each.get(key) is None for each in sequences):
            return None
        return _shaped([each[key] for each in sequences], (len(sequences), columns))

    return Sums(
        measured=measured,
        counts=table(SEGMENTS + POINTS),
        membership=optional("membership", 4),
        distance=binned("distance", len(measured.distance_edges)),
        points=binned("points", len(measured.points_edges)),
        visible=binned("visible", len(VISIBLE)) if seen else None,
        tracks=table(TRACKS) if all("assoc" in each for each in sequences) else None,
        switches=optional("switches", size),
        tq=optional("tq", 2),
    )


def _shaped(rows: Any, shape: tuple[int, ...]) -> Any:
    array = np.asarray(rows, np.float64)
    if array.shape != shape or not np.isfinite(array).all() or (array < 0).any():
        raise ValueError(f"expected numbers >= 0 of shape {shape}, found shape {array.shape}")
    return array
