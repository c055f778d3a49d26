"""Things: what they look like at a time, where they are then, and the box they fill."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from most.simulation.mesh import Mesh
from most.simulation.street import Street

MOVING = {10: 252, 13: 257, 18: 258, 20: 259, 30: 254, 31: 253, 32: 255}  # raw labels of the same class on the move


@dataclass
class Path:
    """A way at constant speed in street coordinates."""

    s: float
    d: float
    along: float = 0.0  # m/s
    across: float = 0.0  # m/s, to the left
    facing: float = 0.0  # radians from the street's direction

    def place(self, street: Street, time: float) -> tuple[Float[np.ndarray, "3"], float]:
        """World position of the foot point (m) and yaw (radians) at ``time``."""
        s = self.s + self.along * time
        return street.position(s, self.d + self.across * time), float(street.heading(s)) + self.facing


@dataclass
class Actor:
    """One instance of a thing class."""

    label: int  # SemanticKITTI's raw class while it stands still
    path: Path
    frames: list[Mesh]  # one cycle of its motion in its own frame, evenly spaced; a single one for what is rigid
    gain: float = 1.0  # of its paint or cloth: dark below 1
    cycles: float = 0.0  # of the motion, 1/s
    start: float = 0.0  # where in the cycle it is at time 0, in [0, 1)
    low: Float[np.ndarray, "3"] = field(init=False)  # corners of the box, own frame
    high: Float[np.ndarray, "3"] = field(init=False)

    def __post_init__(self) -> None:
        self.low = np.min([mesh.vertices.min(0) for mesh in self.frames], 0)
        self.high = np.max([mesh.vertices.max(0) for mesh in self.frames], 0)

    @property
    def moves(self) -> bool:
        """Whether it changes its place."""
        return self.path.along != 0.0 or self.path.across != 0.0

    @property
    def raw_class(self) -> int:
        """Raw label, with SemanticKITTI's own ids for what moves."""
        return MOVING.get(self.label, self.label) if self.moves else self.label

    def mesh(self, time: float) -> Mesh:
        """Shape in its own frame."""
        return self.frames[int((self.start + self.cycles * time) * len(self.frames)) % len(self.frames)]

    def centre(self, street: Street, time: float) -> Float[np.ndarray, "3"]:
        """Centre of the amodal box, world frame, m."""
        position, yaw = self.path.place(street, time)
        c, s = np.cos(yaw), np.sin(yaw)
        x, y, z = 0.5 * (self.low + self.high)
        return position + np.array([c * x - s * y, s * x + c * y, z])

    def velocity(self, street: Street, time: float) -> Float[np.ndarray, "2"]:
        """Of the box's centre, world frame, m/s: the centred difference over one scan."""
        if not self.moves:
            return np.zeros(2)
        return ((self.centre(street, time + 0.05) - self.centre(street, time - 0.05)) / 0.1)[:2]
