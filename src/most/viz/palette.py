"""Colours for a dark ground: bright and distinct for things, muted for stuff, all told apart by the colour-blind."""

import numpy as np
from jaxtyping import Float, Int64
from matplotlib.colors import to_rgb

from most.viz.agreement import Verdict

GROUND = "#0d1117"
INK = "#e6edf3"
FAINT = "#8b949e"
RGB = tuple[float, float, float]
UNCLAIMED = "#ffffff"  # things without an instance
INSTANCES = ("#f5a623", "#56b4e9", "#2fd6a3", "#f0e442", "#ff7f50", "#f0a0d0", "#b8a1ff", "#a8e05f")  # Okabe and Ito's
SHADES = (1.0, 0.72, 0.5)  # of those, where there are more instances than colours
VERDICTS = {
    Verdict.NOT_SCORED: ("not scored", "#21262d"),
    Verdict.RIGHT: ("right", "#56606b"),
    Verdict.WRONG_INSTANCE: ("wrong instance", "#ffd23f"),
    Verdict.WRONG_CLASS: ("wrong class", "#ff3b47"),
}


def muted(colours: list[list[int]]) -> Float[np.ndarray, "classes 3"]:
    """Return the classes' own colours (RGB, 0 to 255), half grey and dark, in [0, 1]."""
    rgb = np.asarray(colours) / 255
    grey = rgb @ np.array([0.3, 0.59, 0.11])
    return 0.12 + 0.56 * (0.62 * rgb + 0.38 * grey[:, None])


def bright(colour: list[int]) -> RGB:
    """Return a class's own colour (RGB, 0 to 255), lifted until it reads on the dark ground, in [0, 1]."""
    red, green, blue = (0.35 + 0.65 * value / 255 for value in colour)
    return red, green, blue


def identity_colour(number: int) -> RGB:
    """Return the colour of a numbered identity, the same at all times; the first two dozen all differ."""
    shade = SHADES[number // len(INSTANCES) % len(SHADES)]
    red, green, blue = to_rgb(INSTANCES[number % len(INSTANCES)])
    return red * shade, green * shade, blue * shade


def numbered(
    segments: Int64[np.ndarray, "points"], points: Float[np.ndarray, "points 3"], taken: dict[int, int]
) -> dict[int, int]:
    """Return a place in ``INSTANCES`` for each segment but 0: the ``taken`` one, else going round by azimuth.

    Neighbours in azimuth so have different colours.
    """
    names, owners = np.unique(segments, return_inverse=True)
    x, y = (np.bincount(owners, points[:, axis], len(names)) for axis in (0, 1))
    round_the_sensor = [int(name) for name in names[np.argsort(np.arctan2(y, x))] if name]
    return {name: taken.get(name, place % len(INSTANCES)) for place, name in enumerate(round_the_sensor)}


def paint(
    semantics: Int64[np.ndarray, "points"],
    segments: Int64[np.ndarray, "points"],
    places: dict[int, int],
    colours: list[list[int]],
    things: list[int],
) -> Float[np.ndarray, "points 3"]:
    """Return each point's colour: its class's if it is stuff, its instance's if it is a thing."""
    painted = muted(colours)[semantics]
    painted[np.isin(semantics, things)] = to_rgb(UNCLAIMED)
    names, owners = np.unique(segments, return_inverse=True)
    bright_colours = np.array([to_rgb(INSTANCES[places[int(name)]]) if name else (0, 0, 0) for name in names]).reshape(
        -1, 3
    )
    is_instance = segments > 0
    painted[is_instance] = bright_colours[owners[is_instance]]
    return painted
