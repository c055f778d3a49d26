"""DS-Net's baseline: points go to where they say their centre is, and mean shift finds where they meet (Table I).

scikit-learn's MeanShift, as DS-Net uses it, takes up to 10 s for the cars of a scan. This one takes the same steps from
the same kind of seeds, all of them at once, on votes that are counted in small cells, and joins seeds that meet.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from most.errors import ConfigError
from most.membership.claims import Claims
from most.membership.clusters import by_class, claims_of
from most.membership.evidence import Channels, Evidence
from most.membership.roi import RegionOfInterest

CELLS = 12  # along a bandwidth: votes in one cell are one place
TICKS = 1000  # in a bandwidth: seeds that are as near are one, and one that moves less has arrived
STEPS = 100  # at most

Places = Float64[np.ndarray, "places 3"]
Seeds = Float64[np.ndarray, "seeds 3"]


@dataclass
class MeanShift:
    """Mean shift with a flat kernel, in each class."""

    bandwidth: float = 1.2  # m; DS-Net's

    needs = "offsets"

    def __post_init__(self) -> None:
        if not self.bandwidth > 0:
            raise ConfigError(f"membership.bandwidth: expected metres above 0, found {self.bandwidth}")

    def build(self, channels: Channels) -> "ShiftedClusters":
        """Make the membership for some classes."""
        return ShiftedClusters(self.bandwidth, channels.things)


@dataclass
class ShiftedClusters:
    """Clusters of points moved by their offsets."""

    bandwidth: float  # m
    things: list[int]  # class ids

    def claim(self, evidence: Evidence, roi: RegionOfInterest, overlap: str) -> Claims:
        """Cluster what the points of each class vote for (:class:`most.membership.Membership`)."""
        assert evidence.offsets is not None  # assembly pairs it with a network that regresses them
        votes = evidence.points + evidence.offsets
        return claims_of(evidence, by_class(votes, evidence.semantics, self.things, self._group))

    def _group(self, index: int, votes: Places) -> Int64[np.ndarray, "places"]:
        return mean_shift(votes, self.bandwidth)


def mean_shift(votes: Float64[np.ndarray, "points 3"], bandwidth: float) -> Int64[np.ndarray, "points"]:
    """Return the cluster of each vote, from 0 without gaps: the nearest of the modes."""
    side = bandwidth / CELLS
    cells, cell_of, weights = np.unique(np.floor(votes / side), axis=0, return_inverse=True, return_counts=True)
    places = (cells + 0.5) * side
    found = modes(places, weights, bandwidth)
    nearest = np.unique(cKDTree(found).query(places)[1], return_inverse=True)[1]
    return nearest.astype(np.int64)[cell_of.reshape(-1)]


def modes(places: Places, weights: Int64[np.ndarray, "places"], bandwidth: float) -> Float64[np.ndarray, "modes 3"]:
    """Return where seeds arrive, one from each occupied cube of a bandwidth's side; none is near a heavier one."""
    tree, tick = cKDTree(places), bandwidth / TICKS
    _, cube = np.unique(np.floor(places / bandwidth), axis=0, return_inverse=True)
    seeds = _means(places, np.ones(len(places)), cube.reshape(-1), int(cube.max()) + 1)[0]
    for _ in range(STEPS):
        moved, _ = _shifted(seeds, tree, places, weights, bandwidth)
        arrived = np.unique(np.round(moved / tick), axis=0) * tick
        if np.array_equal(arrived, seeds):
            break
        seeds = arrived
    _, weight = _shifted(seeds, tree, places, weights, bandwidth)
    return _apart(seeds[np.argsort(-weight, kind="stable")], bandwidth)


def _shifted(
    seeds: Seeds, tree: cKDTree, places: Places, weights: Int64[np.ndarray, "places"], bandwidth: float
) -> tuple[Seeds, Float64[np.ndarray, "seeds"]]:
    """Return the mean of the votes near each seed, and how many they are; a seed without any stays."""
    near = tree.query_ball_point(seeds, bandwidth)
    seed_of = np.repeat(np.arange(len(seeds)), [len(each) for each in near])
    row = np.concatenate([np.asarray(each, dtype=np.int64) for each in near])
    means, total = _means(places[row], weights[row], seed_of, len(seeds))
    return np.where(total[:, None] > 0, means, seeds), total


def _means(
    places: Places, weights: np.ndarray, row: Int64[np.ndarray, "places"], count: int
) -> tuple[Float64[np.ndarray, "rows 3"], Float64[np.ndarray, "rows"]]:
    """Return the weighted mean of each row's places, and its weight."""
    total = np.bincount(row, weights, count)
    sums = [np.bincount(row, weights * axis, count) for axis in places.T]
    return np.stack(sums, 1) / np.maximum(total, 1)[:, None], total


def _apart(seeds: Seeds, bandwidth: float) -> Float64[np.ndarray, "modes 3"]:
    """Drop each seed within a bandwidth of an earlier one that stays."""
    kept = np.ones(len(seeds), dtype=bool)
    for index, near in enumerate(cKDTree(seeds).query_ball_point(seeds, bandwidth)):
        if kept[index]:
            kept[[other for other in near if other > index]] = False
    return seeds[kept]
