"""The ground as a mesh: a net over (s, d) with kerbs as upright cells and crossings cut through."""

import numpy as np
from jaxtyping import Bool, Float, Int

from most.simulation.mesh import Mesh
from most.simulation.street import CURB, Side, Street
from most.simulation.surfaces import Surface

_CELL = 1.5  # m
_MARKING = 0.08  # half-width of the centre line, m


def ground(street: Street, parking: bool, rng: np.random.Generator) -> Mesh:
    """Carriageway, parking, sidewalks, grass; ``parking`` says whether parking space has a surface of its own."""
    s, crossing = _rows(street)
    d, rise, cells = _columns(street)
    if not parking:
        cells = np.where(cells == Surface.PARKING, Surface.ASPHALT, cells)
    xy = street.xy(*np.meshgrid(s, d, indexing="ij"))
    grass = np.append(cells, cells[-1]) == Surface.GRASS
    rough = rng.normal(scale=0.05, size=xy.shape[:2]) * (grass & ~crossing[:, None])
    z = street.hills(xy) + np.where(crossing[:, None], 0.0, rise) + rough
    vertices = np.concatenate([xy, z[..., None]], -1).reshape(-1, 3)
    faces = _net(len(s), len(d))
    road = (crossing[:-1] & crossing[1:])[:, None]
    surfaces = np.where(road, Surface.ASPHALT, cells[None, :])
    return Mesh(vertices, faces, np.repeat(surfaces.reshape(-1), 2))


def _net(rows: int, columns: int) -> Int[np.ndarray, "faces 3"]:
    """Two triangles for each cell of a net, facing up."""
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = row * columns + column
    b = a + columns
    return np.stack([a, b, b + 1, a, b + 1, a + 1], -1).reshape(-1, 3)


def _rows(street: Street) -> tuple[Float[np.ndarray, "rows"], Bool[np.ndarray, "rows"]]:
    """Each row's s and whether it lies in a crossing; a crossing's border is there twice, as one and the other."""
    parts, at = [], street.start
    for middle, half in street.crossings:
        parts += [(_spaced(at, middle - half), False), (_spaced(middle - half, middle + half), True)]
        at = middle + half
    parts.append((_spaced(at, max(street.end, at + _CELL)), False))
    return np.concatenate([s for s, _ in parts]), np.concatenate([np.full(len(s), inside) for s, inside in parts])


def _spaced(low: float, high: float) -> Float[np.ndarray, "places"]:
    """Places at most a cell apart, both ends included."""
    return np.linspace(low, high, max(2, int((high - low) / _CELL) + 2))


def _columns(street: Street) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Each column's d and rise from right to left, and the surface of the cells between them."""
    right, left = (_half(street.sides[side], street.carriageway) for side in (-1, 1))
    d = np.concatenate([-right[0][::-1], left[0]])
    rise = np.concatenate([right[1][::-1], left[1]])
    return d, rise, np.concatenate([right[2][::-1], [Surface.MARKING], left[2]])


def _half(side: Side, carriageway: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One side's columns from the centre line outwards: d, rise, and the surfaces of the cells between them."""
    d, rise, cells, inner = [], [], [], _MARKING
    for outer, surface in side.strips(carriageway):
        at = _spaced(inner, outer)
        low = surface in (Surface.ASPHALT, Surface.PARKING)
        beyond = at - carriageway - side.parking - side.verge - side.sidewalk
        up = np.zeros_like(at) if low else CURB + side.slope * np.maximum(0.0, beyond)
        d.append(at)
        rise.append(up)
        cells.append(np.full(len(at), surface))  # the first of them is the border's: a kerb, or nothing
        inner = outer
    return np.concatenate(d), np.concatenate(rise), np.concatenate(cells)[1:]
