"""PQ of all things together in bins: by distance, by points, and by how much of an object is seen."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from most.metrics.sightings import VISIBLE
from most.reports.figures import FEWEST
from most.reports.sums import Measured


@dataclass(frozen=True)
class Bins:
    """What things are parted by."""

    name: str  # of the figures and of files
    title: str
    axis: str
    meaning: str
    labels: tuple[str, ...]

    @property
    def columns(self) -> dict[str, str]:
        """The figures' keys by label."""
        return {label: f"{self.name}/{index}" for index, label in enumerate(self.labels)}


OFFICIAL = "Segments count as officially."
FEW = f"Bins of fewer than {FEWEST} objects have no figure."
SEEN = (
    "How much of an object is seen: how long its points reach over ground in the scan, of the longest that they ever "
    f"do in the sequence. {OFFICIAL} False segments count for the object that most of their points are of. Left out "
    "are those of no object, and objects that are there in one scan alone. What is little seen, and yet has points "
    f"enough to count, is large and near, and so may have the higher PQ: rows are compared within a bin. {FEW}"
)


def by_distance(measured: Measured) -> Bins:
    """As far as things are from the sensor."""
    labels = _labels(measured.distance_edges, step=0)
    return Bins(
        "distance", "PQ of things against distance", "distance of the modal centre, m", f"{OFFICIAL} {FEW}", labels
    )


def by_points(measured: Measured) -> Bins:
    """As many points as things have."""
    meaning = f"Those too small for the official figure count here, too. {FEW}"
    labels = _labels(measured.points_edges, step=1)
    return Bins("points", "PQ of things against points per instance", "points of the instance", meaning, labels)


def by_visible() -> Bins:
    """As much as is seen of things; the most occluded ones first."""
    labels = tuple(f"{100 * low:g}-{100 * high:g} %" for low, high in pairwise([*VISIBLE, 1.0]))
    return Bins("visible", "PQ of things against occlusion", "share of the object that is seen", SEEN, labels)


def _labels(edges: Sequence[float], step: int) -> tuple[str, ...]:
    """``0-10`` of a distance, ``1-14`` of whole numbers (``step`` 1), and an open end."""
    return *(f"{low:g}-{high - step:g}" for low, high in pairwise(edges)), f"{edges[-1]:g} on"
