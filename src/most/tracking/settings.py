"""Settings of a tracker."""

from dataclasses import dataclass, field

from most.errors import ConfigError
from most.tracking.assignment import greedy, hungarian
from most.tracking.motion import ConstantVelocity, LastVelocity, Motion
from most.tracking.numbers import Numbers
from most.tracking.tracker import Tracker


@dataclass
class TrackerSettings:
    """How observations and tracks find each other; the defaults are the paper's."""

    assignment: str = "greedy"  # greedy: the most confident first; hungarian: least total distance
    motion: str = "velocity"  # velocity: observed, else told by centres; nearest: none; kalman: a filter
    lost_after: float = 1.5  # s out of sight
    kalman: ConstantVelocity = field(default_factory=ConstantVelocity)

    def __post_init__(self) -> None:
        if self.assignment not in ("greedy", "hungarian"):
            raise ConfigError(f"tracker.assignment: expected greedy or hungarian, found {self.assignment}")
        if self.motion not in ("velocity", "nearest", "kalman"):
            raise ConfigError(f"tracker.motion: expected velocity, nearest or kalman, found {self.motion}")
        if not 0 < self.lost_after < float("inf"):
            raise ConfigError(f"tracker.lost_after: expected seconds above 0, found {self.lost_after}")

    def build(self, gates: list[float], largest: int, by_class: bool) -> Tracker:
        """Make the tracker of one sequence.

        ``gates``: m in half a second, by class; ``largest`` number of a track; ``by_class``: numbers are unique
        within a class, not within the sequence. A taxonomy knows all three.
        """
        motion: Motion = self.kalman if self.motion == "kalman" else LastVelocity(self.motion == "velocity")
        assignment = greedy if self.assignment == "greedy" else hungarian
        return Tracker(list(gates), Numbers(largest, by_class), assignment, motion, self.lost_after)
