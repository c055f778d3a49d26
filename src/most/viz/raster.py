"""Points into pixels: far quicker than a scatter plot of a whole scan."""

import numpy as np
from jaxtyping import Bool, Float, UInt8


def rasterise(
    points: Float[np.ndarray, "points 3"],
    colours: Float[np.ndarray, "points 3"],
    prominent: Bool[np.ndarray, "points"],
    reach: float,
    ground: tuple[float, float, float],
    pixels: int,
) -> UInt8[np.ndarray, "pixels pixels 3"]:
    """Return an image (0 to 255) of the square ``reach`` metres around the sensor: x (forward) up, y (left) leftwards.

    Higher points cover lower ones. ``prominent`` points are dots two pixels wide, and on top of all others.
    """
    canvas = np.full((pixels, pixels, 3), _bytes(np.asarray(ground)))
    colours = _bytes(colours)
    at = np.floor((reach - points[:, :2]) * (pixels / (2 * reach))).astype(np.int64)
    inside = ((at >= 0) & (at < pixels)).all(1)
    order = np.flatnonzero(inside)[np.argsort(points[inside, 2], kind="stable")]
    plain, dots = order[~prominent[order]], order[prominent[order]]
    canvas[at[plain, 0], at[plain, 1]] = colours[plain]
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        where = np.clip(at[dots] + (row, column), 0, pixels - 1)
        canvas[where[:, 0], where[:, 1]] = colours[dots]
    return canvas


def _bytes(colours: Float[np.ndarray, "*colours 3"]) -> UInt8[np.ndarray, "*colours 3"]:
    return np.round(colours * 255).astype(np.uint8)
