"""The scenery beside a street: rows of houses, gardens, trees, poles, signs, fences, bins."""

from collections.abc import Iterator

import numpy as np

from most.simulation.mesh import Mesh
from most.simulation.scenery import bin_, building, bush, fence, hedge, lamp, sign, tree
from most.simulation.street import EDGE, Street


def roadside(street: Street, rare: bool, rng: np.random.Generator) -> Iterator[Mesh]:
    """Everything, in the world frame; ``rare`` adds fences, signs and bins."""
    for side in (-1, 1):
        yield from _houses(street, side, rare, rng)
        yield from _trees(street, side, rng)
        yield from _poles(street, side, rare, rng)


def _put(street: Street, mesh: Mesh, s: float, side: int, d: float) -> Mesh:
    """Place a mesh whose -y looks at the street."""
    yaw = float(street.heading(s)) + (0.0 if side > 0 else np.pi)
    return mesh.moved(street.position(s, side * d), yaw)


def _houses(street: Street, side: int, rare: bool, rng: np.random.Generator) -> Iterator[Mesh]:
    """Houses with gaps between them, and what marks the plot's border towards the sidewalk."""
    profile = street.sides[side]
    border = street.carriageway + profile.parking + profile.verge + profile.sidewalk
    gabled, tall = rng.random() < 0.6, rng.uniform(4, 12)
    s = street.start
    while s < street.end:
        length = rng.uniform(8, 22)
        middle = s + length / 2
        if not street.crosses(middle, length / 2 + 3):
            if rng.random() < street.built_up:
                mesh = building(0.94 * length, rng.uniform(8, 13), tall * rng.uniform(0.8, 1.25), gabled)
                yield _put(street, mesh, middle, side, border + profile.setback + rng.uniform(0, 0.8))
            else:
                yield from _garden(street, side, middle, length, border, rng)
            for _ in range(rng.integers(0, 3)):  # tall trees behind
                at = middle + rng.uniform(-0.5, 0.5) * length
                yield _put(street, tree(rng).scaled(rng.uniform(1.3, 2.0)), at, side, rng.uniform(border + 14, EDGE))
            if profile.setback > 2.5:
                yield from _plot(street, side, middle, length, border, rare, rng)
        s += length + rng.choice([0.0, 3.0], p=[0.6, 0.4])


def _garden(
    street: Street, side: int, s: float, length: float, border: float, rng: np.random.Generator
) -> Iterator[Mesh]:
    """Trees and shrubs where no house stands."""
    for _ in range(int(length / 1.6)):
        mesh = tree(rng) if rng.random() < 0.45 else bush(rng)
        d = border + 1.5 + rng.uniform(0, 1) ** 1.5 * (EDGE - border - 8)
        yield _put(street, mesh, s + rng.uniform(-0.5, 0.5) * length, side, d)


def _plot(
    street: Street, side: int, s: float, length: float, border: float, rare: bool, rng: np.random.Generator
) -> Iterator[Mesh]:
    """Hedge or fence along the sidewalk, and a shrub or two behind it."""
    draw = rng.random()
    if rare and draw < 0.3:
        yield _put(street, fence(0.8 * length, rng.uniform(0.9, 1.7)), s, side, border + 0.2)
    elif draw < 0.7:
        yield _put(street, hedge(0.8 * length, rng.uniform(0.8, 1.8), rng), s, side, border + 0.5)
    for _ in range(rng.integers(0, 3)):
        at = s + rng.uniform(-0.4, 0.4) * length
        yield _put(street, bush(rng), at, side, border + rng.uniform(1.0, street.sides[side].setback - 0.8))


def _trees(street: Street, side: int, rng: np.random.Generator) -> Iterator[Mesh]:
    """Trees in the verge, or none."""
    profile = street.sides[side]
    s = street.start + rng.uniform(0, 10)
    while profile.verge and s < street.end:
        if not street.crosses(s, 5):
            yield _put(street, tree(rng), s, side, street.carriageway + profile.parking + 0.5 * profile.verge)
        s += rng.uniform(6, 13)


def _poles(street: Street, side: int, rare: bool, rng: np.random.Generator) -> Iterator[Mesh]:
    """Lamps, signs and bins at the kerb."""
    kerb = street.carriageway + street.sides[side].parking + 0.35
    s = street.start + rng.uniform(0, 20)
    while s < street.end:
        if not street.crosses(s, 2):
            yield _put(street, lamp(rng), s, side, kerb)
            if rare and rng.random() < 0.6:
                yield _put(street, sign(rng), s + rng.uniform(5, 8), side, kerb)
            if rare and rng.random() < 0.4:
                yield _put(street, bin_(rng), s + rng.uniform(2, 4), side, kerb + 0.1)
        s += rng.uniform(14, 30)
