"""What things are made of: how much light a surface gives back, and the label of the scenery made of it."""

from enum import IntEnum

import numpy as np


class Surface(IntEnum):
    """A material; the first ones are scenery and carry SemanticKITTI's raw label, the others belong to instances."""

    ASPHALT = 0
    MARKING = 1
    PARKING = 2
    PAVING = 3
    GRASS = 4
    WALL = 5
    WINDOW = 6
    ROOF = 7
    FENCE = 8
    LEAF = 9
    BARK = 10
    POLE = 11
    SIGN = 12
    BIN = 13
    PAINT = 14
    GLASS = 15
    TYRE = 16
    CARGO = 17
    CLOTH = 18
    SKIN = 19
    TUBE = 20


_TABLE = {  # raw label (0: the instance's), share of the light that comes back at normal incidence
    Surface.ASPHALT: (40, 0.20),
    Surface.MARKING: (60, 0.70),
    Surface.PARKING: (44, 0.26),
    Surface.PAVING: (48, 0.36),
    Surface.GRASS: (72, 0.48),
    Surface.WALL: (50, 0.36),
    Surface.WINDOW: (50, 0.02),
    Surface.ROOF: (50, 0.30),
    Surface.FENCE: (51, 0.42),
    Surface.LEAF: (70, 0.42),
    Surface.BARK: (71, 0.30),
    Surface.POLE: (80, 0.50),
    Surface.SIGN: (81, 0.95),
    Surface.BIN: (99, 0.40),
    Surface.PAINT: (0, 0.46),
    Surface.GLASS: (0, 0.01),
    Surface.TYRE: (0, 0.08),
    Surface.CARGO: (0, 0.55),
    Surface.CLOTH: (0, 0.35),
    Surface.SKIN: (0, 0.50),
    Surface.TUBE: (0, 0.45),
}
LABELS = np.array([_TABLE[surface][0] for surface in Surface], np.uint32)
_GLOSSY = (Surface.PAINT, Surface.GLASS, Surface.WINDOW)
GLOSS = np.array([1.2 if surface in _GLOSSY else 0.5 for surface in Surface], np.float32)  # exponent of the cosine
REFLECTIVITY = np.array([_TABLE[surface][1] for surface in Surface], np.float32)
