"""Cars, vans, trucks and buses: lofted hulls with cabins, windows and wheels."""

import numpy as np

from most.simulation.mesh import Mesh, box, loft, merge, tube
from most.simulation.surfaces import Surface


def _wheels(length: float, width: float, radius: float, axles: tuple[float, ...]) -> list[Mesh]:
    """A pair of wheels at each axle, given as a share of the length from the middle."""
    outer, inner = width / 2 - 0.03, width / 2 - 0.25
    return [
        tube((axle * length, side * inner, radius), (axle * length, side * outer, radius), radius, Surface.TYRE, 10)
        for axle in axles
        for side in (-1, 1)
    ]


def _hull(stations: list[tuple[float, float, float]], length: float, width: float, bottom: float) -> Mesh:
    """A body along x: each station is (x / length, half-width / half of width, top in m)."""
    rings = []
    for x, half, top in stations:
        w, shoulder = half * width / 2, max(bottom + 0.12, top - 0.12)
        left = [(0.85 * w, bottom), (w, bottom + 0.1), (w, shoulder), (0.86 * w, top)]
        rings.append([(x * length, y, z) for y, z in left] + [(x * length, -y, z) for y, z in reversed(left)])
    return loft(np.array(rings), Surface.PAINT)


def _cabin(back: tuple[float, float], front: tuple[float, float], width: float, belt: float, roof: float) -> Mesh:
    """Windows under a roof: where (at the belt, at the roof) the rear and the front window stand, in m along x."""
    rings = []
    for share, z in ((0.0, belt - 0.05), (0.85, belt + 0.85 * (roof - belt)), (1.0, roof)):
        x0, x1 = back[0] + share * (back[1] - back[0]), front[0] + share * (front[1] - front[0])
        y = (0.93 - 0.16 * share) * width / 2
        corner = 0.12
        ring = [(x0, y - corner), (x0 + corner, y), (x1 - corner, y), (x1, y - corner)]
        rings.append([(x, v, z) for x, v in ring] + [(x, -v, z) for x, v in reversed(ring)])
    glazed = loft(np.array(rings), Surface.GLASS, caps=Surface.PAINT)
    glazed.surfaces[16:32] = Surface.PAINT  # the frame above the windows
    return glazed


def car(rng: np.random.Generator) -> Mesh:
    """A saloon, hatchback or estate, 3.6 to 4.9 m long."""
    kind = rng.integers(3)
    length = float(rng.uniform(3.6, 4.2) if kind == 1 else rng.uniform(4.3, 4.9))
    width, height = float(rng.uniform(1.65, 1.85)), float(rng.uniform(1.42, 1.52) + 0.12 * (kind == 2))
    belt = 0.62 * height
    rear = 0.60 * height if kind == 0 else 0.66 * height
    hull = _hull(
        [
            *((-0.5, 0.80, 0.50), (-0.485, 0.93, rear), (-0.3, 1.0, belt), (0.15, 1.0, belt)),
            *((0.30, 0.98, 0.60 * height), (0.45, 0.92, 0.52 * height), (0.5, 0.75, 0.45)),
        ],
        length,
        width,
        bottom=0.22,
    )
    back = (-0.34 * length, -0.22 * length) if kind == 0 else (-0.48 * length, -0.40 * length)
    cabin = _cabin(back, (0.24 * length, 0.06 * length), width, belt, height)
    return merge([hull, cabin, *_wheels(length, width, 0.31, (-0.3, 0.31))])


def van(rng: np.random.Generator) -> Mesh:
    """A delivery van, one tall body."""
    length, width, height = rng.uniform(4.9, 5.9), rng.uniform(1.9, 2.05), rng.uniform(2.1, 2.5)
    hull = _hull(
        [
            *((-0.5, 0.95, height - 0.1), (-0.49, 1.0, height), (0.2, 1.0, height), (0.28, 0.98, 0.95 * height)),
            *((0.40, 0.96, 0.52 * height), (0.49, 0.9, 0.45 * height), (0.5, 0.8, 0.8)),
        ],
        length,
        width,
        bottom=0.25,
    )
    return merge([hull, *_wheels(length, width, 0.34, (-0.3, 0.33))])


def truck(rng: np.random.Generator) -> Mesh:
    """A lorry: cab, gap, cargo box on a chassis, three axles."""
    length, width, height = rng.uniform(7.0, 9.5), rng.uniform(2.35, 2.5), rng.uniform(3.2, 3.7)
    front, cab = length / 2, rng.uniform(1.8, 2.2)
    corner = [(-width / 2, 0.0), (-width / 2, 0.85), (-0.42 * width, 1.0), (0.42 * width, 1.0), (width / 2, 0.85)]
    outline = [*corner, (width / 2, 0.0)]
    rings = [
        [(front - cab + depth * share, y, z) for y, share in outline]
        for z, depth in ((0.5, cab), (1.5, cab), (1.55, cab - 0.03), (2.5, cab - 0.2), (2.75, cab - 0.45))
    ]
    head = loft(np.array(rings), Surface.PAINT)
    head.surfaces[24:36] = Surface.GLASS  # the band between 1.55 and 2.5 m
    cargo = box((-length / 2, -width / 2, 1.05), (front - cab - 0.35, width / 2, height), Surface.CARGO)
    chassis = box((-length / 2 + 0.3, -0.45, 0.6), (front - 0.5, 0.45, 1.05), Surface.TYRE)
    return merge([head, cargo, chassis, *_wheels(length, width, 0.48, (-0.34, -0.2, 0.36))])


def bus(rng: np.random.Generator) -> Mesh:
    """A city bus with a band of windows."""
    length, width, height = rng.uniform(10.5, 12.0), 2.5, rng.uniform(2.95, 3.2)
    ring = [(-0.5, -0.44), (-0.48, -0.5), (0.48, -0.5), (0.5, -0.44), (0.5, 0.44), (0.48, 0.5), (-0.48, 0.5)]
    outline = [*ring, (-0.5, 0.44)]
    levels = ((0.3, 1.0), (1.2, 1.0), (2.3, 0.98), (height - 0.1, 0.97), (height, 0.9))
    rings = [[(x * length * share, y * width * share, z) for x, y in outline] for z, share in levels]
    body = loft(np.array(rings), Surface.PAINT)
    body.surfaces[16:32] = Surface.GLASS
    return merge([body, *_wheels(length, width, 0.48, (-0.3, 0.32))])
