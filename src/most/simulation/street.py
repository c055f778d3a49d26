"""A street: where it bends, how its cross-section is divided, and how high the ground lies.

A place on it is (s, d): metres along its centre line and metres to the left of it. s = 0 is where the sensor starts,
heading along +x of the world; traffic keeps to the right, that is to negative d.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from most.simulation.surfaces import Surface

EDGE = 46.0  # half-width of the modelled ground, m: below every radius of the bends, so that it never folds
CURB = 0.13  # m
_STEP = 0.5  # of the centre line's table, m


@dataclass
class Side:
    """One side's cross-section from the outer edge of the carriageway outwards, widths in m (0: there is none)."""

    parking: float
    slant: float  # how far parked cars are turned from the street's direction, radians; 0 parks them in a row
    paved: bool  # the parking space has a surface of its own; else it is the carriageway's
    verge: float  # grass with trees between kerb and sidewalk
    sidewalk: float
    setback: float  # from the sidewalk to the houses
    slope: float  # rise of the ground beyond the sidewalk, m per m

    def strips(self, carriageway: float) -> list[tuple[float, Surface]]:
        """(outer border d, surface) of each strip, from the centre line outwards, d > 0."""
        widths = [
            (carriageway, Surface.ASPHALT),
            (self.parking, Surface.PARKING if self.paved else Surface.ASPHALT),
            (self.verge, Surface.GRASS),
        ]
        borders, at = [], 0.0
        for width, surface in [*widths, (self.sidewalk, Surface.PAVING)]:
            at += width
            borders += [(at, surface)] if width else []
        return [*borders, (EDGE, Surface.GRASS)]


class Street:
    """Layout drawn from ``rng``, for a drive of ``drive`` m that sees ``reach`` m far."""

    def __init__(self, drive: float, reach: float, rng: np.random.Generator) -> None:
        self.start, self.end = -reach, drive + reach
        self.lanes = int(rng.choice([1, 1, 1, 1, 2]))  # each way
        self.lane_width = float(rng.uniform(2.9, 3.4))
        self.carriageway = self.lanes * self.lane_width + 1.1  # half of it; the rest is where bicycles ride
        self.sides = {side: _draw_side(rng) for side in (-1, 1)}
        self.built_up = float(rng.uniform(0.35, 0.9))  # share of the street's length that is lined with houses
        self.crossings = _draw_crossings(self.start, self.end, rng)
        self._bends = rng.uniform((0.12, 150, 0), (0.42, 260, 2 * np.pi), (2, 3)) * (rng.choice([-1, 1]), 1, 1)
        self._hills = rng.uniform((0.1, 90, 0, 0), (0.45, 200, 2 * np.pi, 2 * np.pi), (3, 4))
        self._s = np.arange(self.start - 30, self.end + 30, _STEP)
        heading = self.heading(self._s)
        line = np.cumsum(_STEP * np.stack([np.cos(heading), np.sin(heading)], 1), 0)
        self._line = line - line[np.searchsorted(self._s, 0.0)]

    def heading(self, s: Float[np.ndarray, "*n"] | float) -> Float[np.ndarray, "*n"] | float:
        """Direction of the centre line, radians in the world frame."""
        waves = [a * (np.sin(2 * np.pi * np.asarray(s) / length + p) - np.sin(p)) for a, length, p in self._bends]
        return np.sum(waves, axis=0)

    def xy(self, s: Float[np.ndarray, "*n"] | float, d: Float[np.ndarray, "*n"] | float) -> Float[np.ndarray, "*n 2"]:
        """World position of places, without the height."""
        heading = self.heading(s)
        centre = np.stack([np.interp(s, self._s, self._line[:, k]) for k in (0, 1)], -1)
        return centre + np.asarray(d)[..., None] * np.stack([-np.sin(heading), np.cos(heading)], -1)

    def hills(self, xy: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n"] | float:
        """Height of the undulating land the street is laid on, m."""
        waves = [
            a * (np.sin(2 * np.pi * (xy[..., 0] * np.cos(w) + xy[..., 1] * np.sin(w)) / length + p) - np.sin(p))
            for a, length, w, p in self._hills
        ]
        return np.sum(waves, axis=0)

    def rise(self, d: float) -> float:
        """Height above the carriageway of the cross-section at ``d``, away from crossings, m."""
        side = self.sides[1 if d > 0 else -1]
        beyond = abs(d) - self.carriageway - side.parking
        if beyond <= 0:
            return 0.0
        return CURB + side.slope * max(0.0, beyond - side.verge - side.sidewalk)

    def crosses(self, s: float, margin: float) -> bool:
        """Whether s lies within ``margin`` m of a crossing."""
        return any(abs(s - middle) < half + margin for middle, half in self.crossings)

    def position(self, s: float, d: float) -> Float[np.ndarray, "3"]:
        """World position of a place on the ground."""
        xy = self.xy(s, d)
        return np.array([*xy, self.hills(xy) + (0.0 if self.crosses(s, 0.0) else self.rise(d))])


def _draw_side(rng: np.random.Generator) -> Side:
    draw = rng.random()
    slanted, parking = draw < 0.15, draw < 0.7
    return Side(
        parking=float(rng.uniform(4.6, 5.0) if slanted else rng.uniform(2.1, 2.5)) * parking,
        slant=float(rng.uniform(0.9, np.pi / 2)) * slanted,
        paved=bool(rng.random() < 0.35),
        verge=float(rng.uniform(1.2, 2.5)) if rng.random() < 0.6 else 0.0,
        sidewalk=float(rng.uniform(2.5, 4.8)),
        setback=float(rng.uniform(0.6, 8.0)),
        slope=float(rng.uniform(-0.02, 0.06)),
    )


def _draw_crossings(start: float, end: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """(s of the middle, half-width) of the streets that cross this one, 70 to 160 m apart."""
    crossings, s = [], start + float(rng.uniform(20, 110))
    while s < end:
        crossings.append((s, float(rng.uniform(3.0, 5.0))))
        s += float(rng.uniform(70, 160))
    return crossings
