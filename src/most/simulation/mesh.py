"""Triangle meshes and the few solids that every shape is put together from."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
import trimesh
from jaxtyping import Float, Int

from most.simulation.surfaces import Surface

Vector = Sequence[float] | Float[np.ndarray, "3"]


@dataclass
class Mesh:
    """Triangles, each with its surface; metres, x forward, y left, z up, standing on z = 0 unless said otherwise."""

    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    surfaces: Int[np.ndarray, "faces"]  # of ``Surface``

    def moved(self, position: Vector, yaw: float = 0.0) -> "Mesh":
        """Turn by ``yaw`` (radians) about z, then shift."""
        return Mesh(self.vertices @ rotation(yaw).T + np.asarray(position), self.faces, self.surfaces)

    def scaled(self, factor: float) -> "Mesh":
        """Larger or smaller about the origin."""
        return Mesh(self.vertices * factor, self.faces, self.surfaces)


def rotation(yaw: float) -> Float[np.ndarray, "3 3"]:
    """Rotation about z by ``yaw`` radians."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one."""
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, first, strict=False)]),
        np.concatenate([mesh.surfaces for mesh in meshes]),
    )


@cache
def _loft_faces(rings: int, corners: int) -> Int[np.ndarray, "faces 3"]:
    ring, corner = np.meshgrid(np.arange(rings - 1), np.arange(corners), indexing="ij")
    a, b = ring * corners + corner, ring * corners + (corner + 1) % corners
    sides = np.stack([a, b, b + corners, a, b + corners, a + corners], -1).reshape(-1, 3)
    fan = np.stack([np.zeros(corners - 2, int), np.arange(1, corners - 1), np.arange(2, corners)], 1)
    return np.concatenate([sides, fan[:, ::-1], fan + (rings - 1) * corners])


def loft(rings: Float[np.ndarray, "rings corners 3"], sides: Surface, caps: Surface | None = None) -> Mesh:
    """A skin over cross-sections of equally many corners, closed at both ends."""
    count, corners = rings.shape[:2]
    faces = _loft_faces(count, corners)
    surfaces = np.full(len(faces), sides)
    surfaces[-2 * (corners - 2) :] = sides if caps is None else caps
    return Mesh(rings.reshape(-1, 3).astype(float), faces, surfaces)


def tube(start: Vector, end: Vector, radius: float, surface: Surface, sides: int = 6, taper: float = 1.0) -> Mesh:
    """A round bar from ``start`` to ``end``; ``taper`` is its radius at the end relative to the start."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    axis = (b - a) / np.linalg.norm(b - a)
    across = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)[:, None]
    circle = radius * (np.cos(turn) * across + np.sin(turn) * np.cross(axis, across))
    return loft(np.stack([a + circle, b + taper * circle]), surface)


def chain(points: Sequence[Vector], radius: float, surface: Surface, sides: int = 4) -> Mesh:
    """Round bars from point to point, open at their ends, since the next one or something else covers them."""
    bars = [tube(a, b, radius, surface, sides) for a, b in pairwise(points)]
    for bar in bars:
        bar.faces, bar.surfaces = bar.faces[: 2 * sides], bar.surfaces[: 2 * sides]
    return merge(bars)


def box(low: Vector, high: Vector, surface: Surface) -> Mesh:
    """A box along the axes between two corners."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    ring = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    return loft(np.array([[(x, y, z) for x, y in ring] for z in (z0, z1)], float), surface)


@cache
def _sphere(subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=1.0)
    return np.array(sphere.vertices), np.array(sphere.faces)


def ellipsoid(centre: Vector, radii: Vector, surface: Surface, subdivisions: int = 1) -> Mesh:
    """An ellipsoid along the axes."""
    vertices, faces = _sphere(subdivisions)
    return Mesh(vertices * radii + np.asarray(centre), faces, np.full(len(faces), surface))


def leaves(centre: Vector, radii: Vector, count: int, size: float, rng: np.random.Generator) -> Mesh:
    """Loose triangles within an ellipsoid, denser towards its skin: foliage, which lets some of the light through."""
    way = rng.normal(size=(count, 3))
    way *= rng.uniform(0.2, 1.0, (count, 1)) ** 0.5 / np.linalg.norm(way, axis=1, keepdims=True)
    corners = (np.asarray(centre) + way * radii)[:, None] + rng.normal(scale=size, size=(count, 3, 3))
    return Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), np.full(count, Surface.LEAF))
