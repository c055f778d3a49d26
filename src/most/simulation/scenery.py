"""What stands along a street and never moves: buildings, trees, hedges, poles, signs, fences, bins."""

import numpy as np

from most.simulation.mesh import Mesh, box, chain, ellipsoid, leaves, loft, merge, tube
from most.simulation.surfaces import Surface


def building(length: float, depth: float, height: float, gabled: bool) -> Mesh:
    """A house along x whose front, with recessed windows, is the plane y = 0; it reaches to y = ``depth``."""
    body = box((-length / 2, 0.2, -1.5), (length / 2, depth, height), Surface.WALL)
    return merge([body, _front(length, height), _roof(length, depth, height, gabled)])


def _front(length: float, height: float) -> Mesh:
    """The sheet with window openings before the body, and the panes in them."""
    columns, floors = max(1, int(length / 2.6)), max(1, int(height / 3.0))
    x = np.linspace(-length / 2, length / 2, 2 * columns + 2)
    z = np.concatenate([[-1.5], np.linspace(1.0, height, 2 * floors, endpoint=False), [height]])
    parts = []
    for i in range(len(x) - 1):
        for j in range(len(z) - 1):
            window = i % 2 == 1 and j % 2 == 1
            y, surface = (0.16, Surface.WINDOW) if window else (0.0, Surface.WALL)
            parts.append(box((x[i], y, z[j]), (x[i + 1], 0.2, z[j + 1]), surface))
    return merge(parts)


def _roof(length: float, depth: float, height: float, gabled: bool) -> Mesh:
    rise = 0.35 * depth if gabled else 0.4
    ridge = depth / 2 if gabled else 0.0
    low, high = (-0.3, depth + 0.3), (ridge - 0.3 + 0.3 * gabled, depth + 0.3 - ridge - 0.3 * gabled)
    rings = [
        [(x, y, z) for x, y in ((-length / 2, a), (length / 2, a), (length / 2, b), (-length / 2, b))]
        for z, (a, b) in ((height, low), (height + rise, high))
    ]
    return loft(np.array(rings), Surface.ROOF)


def tree(rng: np.random.Generator) -> Mesh:
    """A trunk that forks into a few clouds of leaves, or a conifer."""
    fork, radius = rng.uniform(1.9, 3.2), rng.uniform(0.10, 0.24)
    if rng.random() < 0.25:
        top = rng.uniform(6, 10)
        rings = [
            leaves((0, 0, z), (w, w, 0.7), int(150 * w) + 30, 0.16, rng)
            for z, w in zip(np.linspace(1.3, top, 8), np.linspace(1.8, 0.3, 8), strict=True)
        ]
        return merge([tube((0, 0, -0.4), (0, 0, top), radius, Surface.BARK, 7, taper=0.2), *rings])
    parts = [tube((0, 0, -0.4), (0, 0, fork), radius, Surface.BARK, 8, taper=0.8)]
    for _ in range(rng.integers(2, 5)):
        way = rng.uniform(-1.3, 1.3, 2)
        centre = np.array([*way, fork + rng.uniform(1.0, 3.2)])
        parts.append(tube((0, 0, fork - 0.1), centre, 0.5 * radius, Surface.BARK, 5, taper=0.3))
        parts.append(leaves(centre, rng.uniform((1.2, 1.2, 0.9), (2.3, 2.3, 1.8)), 300, 0.28, rng))
    return merge(parts)


def bush(rng: np.random.Generator) -> Mesh:
    """A shrub down to the ground."""
    radii = rng.uniform((0.6, 0.6, 0.5), (1.6, 1.2, 1.2))
    core = ellipsoid((0, 0, 0.5 * radii[2]), 0.7 * radii, Surface.LEAF)
    return merge([core, leaves((0, 0, 0.6 * radii[2]), radii, 220, 0.14, rng)])


def hedge(length: float, height: float, rng: np.random.Generator) -> Mesh:
    """A clipped row along x."""
    core = box((-length / 2, -0.3, -0.3), (length / 2, 0.3, 0.9 * height), Surface.LEAF)
    rough = leaves((0, 0, 0.55 * height), (length / 2, 0.4, 0.5 * height), int(50 * length), 0.10, rng)
    return merge([core, rough])


def lamp(rng: np.random.Generator) -> Mesh:
    """A street lamp: a mast and an arm towards the road (-y)."""
    height = rng.uniform(5, 8)
    return merge(
        [
            tube((0, 0, -0.3), (0, 0, height), 0.10, Surface.POLE, 8, taper=0.6),
            chain([(0, 0, height - 0.1), (0, -1.2, height + 0.2)], 0.06, Surface.POLE, 5),
            box((-0.12, -1.7, height + 0.1), (0.12, -1.1, height + 0.25), Surface.POLE),
        ]
    )


def sign(rng: np.random.Generator) -> Mesh:
    """A traffic sign facing those who drive along +x: post, and a plate that is a disc or a board."""
    height, radius = rng.uniform(2.2, 2.8), rng.uniform(0.3, 0.45)
    post = tube((0, 0, -0.3), (0, 0, height), 0.045, Surface.POLE, 6)
    corners = 4 if rng.random() < 0.5 else 12
    turn = np.linspace(0, 2 * np.pi, corners, endpoint=False) + np.pi / 4
    disc = np.stack([np.zeros(corners), radius * np.cos(turn), height + radius * np.sin(turn)], 1)
    return merge([post, loft(np.stack([disc - (0.08, 0, 0), disc - (0.05, 0, 0)]), Surface.SIGN)])


def fence(length: float, height: float) -> Mesh:
    """Slats along x with gaps between them, on two rails."""
    slats = [
        box((x, -0.02, 0.05), (x + 0.14, 0.02, height), Surface.FENCE)
        for x in np.arange(-length / 2, length / 2 - 0.14, 0.2)
    ]
    rails = [
        box((-length / 2, 0.02, z), (length / 2, 0.06, z + 0.1), Surface.FENCE) for z in (0.25 * height, 0.75 * height)
    ]
    return merge(slats + rails)


def bin_(rng: np.random.Generator) -> Mesh:
    """A wheeled bin."""
    height = rng.uniform(0.95, 1.3)
    rings = [[(-a, -a, z), (a, -a, z), (a, a, z), (-a, a, z)] for z, a in ((0.05, 0.24), (height, 0.32))]
    lid = box((-0.34, -0.34, height), (0.34, 0.36, height + 0.06), Surface.BIN)
    return merge([loft(np.array(rings), Surface.BIN), lid])
