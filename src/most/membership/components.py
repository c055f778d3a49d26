"""Points seen from above, joined where they are near, and cut where what was joined is too long for one object."""

import itertools

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, Delaunay

CELL = 0.1  # m: points in a square of this side are one
FARTHEST = 1e4  # m: what lies farther off is put there

Ground = Float64[np.ndarray, "points 2"]
Box = Float64[np.ndarray, "2"]  # length and width, m


def components(ground: Ground, radius: float, box: Box, margin: float) -> Int64[np.ndarray, "points"]:
    """Return the component of each point, from 0 without gaps: chains of cells at most ``radius`` (m) apart.

    Those that no rectangle of ``margin`` times ``box`` holds are cut until one does.
    """
    kept = np.floor(ground.clip(-FARTHEST, FARTHEST) / CELL)
    cells, cell_of = np.unique(kept, axis=0, return_inverse=True)
    middles = (cells + 0.5) * CELL
    pieces = [piece for whole in _groups(linked(middles, radius)) for piece in cut(middles, whole, box, margin)]
    component = np.empty(len(cells), dtype=np.int64)
    for number, piece in enumerate(pieces):
        component[piece] = number
    return component[cell_of.reshape(-1)]


def linked(places: Ground, radius: float) -> Int64[np.ndarray, "points"]:
    """Return the connected components of the graph of all pairs at most ``radius`` apart; no two places are the same.

    The shortest tree over the places lies in their Delaunay triangulation, so its few edges decide it exactly.
    """
    count, middle = len(places), (places.min(0) + places.max(0)) / 2
    far = 10 * (np.ptp(places, axis=0).max() + radius) * np.array([[0.0, 2.0], [-2.0, -1.0], [2.0, -1.0]])
    corners = Delaunay(np.concatenate([places, middle + far])).simplices  # far corners: any places make triangles
    edges = np.concatenate([corners[:, pair] for pair in itertools.combinations(range(3), 2)])
    edges = edges[(edges < count).all(1)]
    edges = edges[np.linalg.norm(places[edges[:, 0]] - places[edges[:, 1]], axis=1) <= radius + 1e-9]
    links = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    return connected_components(links, directed=False)[1].astype(np.int64)


def cut(middles: Ground, piece: Int64[np.ndarray, "cells"], box: Box, margin: float) -> list[np.ndarray]:
    """Return the parts of a piece (rows of ``middles``) that are small enough.

    It is cut at its widest gap, but no crumbs off it. What is no wider than one object is a row of them, one behind the
    other; what is wider may consist of neighbours either way.
    """
    axes, sides = smallest_rectangle(middles[piece])
    if (sides <= margin * box).all():
        return [piece]
    in_line = sides[1] <= margin * box[1]
    reserve = (box[0] if in_line else box[1]) / 2
    gaps = [(*_widest_gap(middles[piece] @ axis, reserve), axis) for axis in (axes[:1] if in_line else axes)]
    width, place, axis = max(gaps, key=lambda gap: gap[0])  # of equals the longer side's
    if width == 0:
        return [piece]
    upper = middles[piece] @ axis > place
    return [part for half in (piece[~upper], piece[upper]) for part in cut(middles, half, box, margin)]


def _widest_gap(along: Float64[np.ndarray, "cells"], reserve: float) -> tuple[float, float]:
    """Return how wide the widest gap is, ``reserve`` off both ends, and its middle; of equals the innermost."""
    values = np.unique(along.round(6))
    if len(values) == 1:
        return 0.0, values[0]
    middle = (values[0] + values[-1]) / 2
    inside = values[:-1] <= max(values[-1] - reserve, middle)
    inside &= values[1:] >= min(values[0] + reserve, middle)
    centres, widths = ((values[1:] + values[:-1]) / 2)[inside], np.diff(values)[inside].round(6)
    chosen = np.lexsort([abs(centres - middle), -widths])[0]
    return float(widths[chosen]), float(centres[chosen])


def smallest_rectangle(middles: Ground) -> tuple[Float64[np.ndarray, "2 2"], Float64[np.ndarray, "2"]]:
    """Return the axes (rows) and sides of the smallest rectangle about some cells, the longer side first, m."""
    corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) * CELL / 2
    points = (middles[:, None] + corners).reshape(-1, 2)
    hull = points[ConvexHull(points).vertices]
    edges = np.roll(hull, -1, axis=0) - hull  # one side of the smallest lies on an edge
    along = edges / np.linalg.norm(edges, axis=1, keepdims=True)
    axes = np.stack([along, np.stack([-along[:, 1], along[:, 0]], 1)], 1)  # edges, 2, 2
    sides = np.ptp(hull @ axes.transpose(0, 2, 1), axis=1)
    smallest = sides.prod(1).argmin()
    order = (-sides[smallest]).argsort()
    return axes[smallest][order], sides[smallest][order]


def _groups(component: Int64[np.ndarray, "cells"]) -> list[np.ndarray]:
    """Return the rows of each component."""
    ends = np.bincount(component).cumsum()[:-1]
    return np.split(component.argsort(kind="stable"), ends)
