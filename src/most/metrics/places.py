"""Where the segments of a scan's things are, and how long they are."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64, Int64
from torch import Tensor

from most.metrics.overlaps import Overlaps, Segments, among

ANGLES = np.arange(12) * np.pi / 12  # in which lengths are taken; the longest in any direction is 1 % more at most


@dataclass
class Places:
    """Over ground, in m; of stuff all is 0."""

    pred: Float64[np.ndarray, "predicted"]  # how far the mean of a segment's points is from the sensor
    truth: Float64[np.ndarray, "true"]  # likewise
    lengths: Float64[np.ndarray, "true"]  # from one end of a true segment's points to the other

    @classmethod
    def of(
        cls,
        points: Float[Tensor, "points 3"],
        overlaps: Overlaps,
        pred: tuple[Int64[Tensor, "points"], Int64[Tensor, "points"]],
        truth: tuple[Int64[Tensor, "points"], Int64[Tensor, "points"]],
        things: Sequence[int],
    ) -> "Places":
        """Measure the segments of ``overlaps``, which were found in ``pred`` and ``truth``: classes and keys."""
        ground = points[:, :2].cpu().numpy()
        said = _distances(*_things(ground, overlaps.pred, *pred, things), len(overlaps.pred.keys))
        true, segment = _things(ground, overlaps.truth, *truth, things)
        count = len(overlaps.truth.keys)
        return cls(said, _distances(true, segment, count), _lengths(true, segment, count))


def _things(
    ground: Float[np.ndarray, "points 2"],
    segments: Segments,
    classes: Int64[Tensor, "points"],
    keys: Int64[Tensor, "points"],
    things: Sequence[int],
) -> tuple[Float[np.ndarray, "own 2"], Int64[np.ndarray, "own"]]:
    """Return the points of things, and the index of each one's segment."""
    of_point, key = classes.cpu().numpy(), keys.cpu().numpy()
    own = np.flatnonzero(among(of_point, things) & np.isfinite(ground).all(1))
    stride = max(things) + 1
    things_at = np.flatnonzero(among(segments.classes, things))
    codes = segments.keys[things_at] * stride + segments.classes[things_at]  # ascending, as segments are
    return ground[own], things_at[np.searchsorted(codes, key[own] * stride + of_point[own])]


def _distances(
    places: Float[np.ndarray, "own 2"], segment: Int64[np.ndarray, "own"], count: int
) -> Float64[np.ndarray, "segments"]:
    points = np.maximum(np.bincount(segment, minlength=count), 1)
    x, y = (np.bincount(segment, axis, count) / points for axis in places.T)
    return np.hypot(x, y)


def _lengths(
    places: Float[np.ndarray, "own 2"], segment: Int64[np.ndarray, "own"], count: int
) -> Float64[np.ndarray, "segments"]:
    lengths = np.zeros(count)
    if not len(segment):
        return lengths
    order = np.argsort(segment, kind="stable")
    along = places[order].astype(np.float64) @ np.stack([np.cos(ANGLES), np.sin(ANGLES)])
    first = np.flatnonzero(np.diff(segment[order], prepend=-1))
    reach = np.maximum.reduceat(along, first) - np.minimum.reduceat(along, first)
    lengths[segment[order[first]]] = reach.max(1)
    return lengths
