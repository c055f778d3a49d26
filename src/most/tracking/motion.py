"""How tracks are taken to move between two sightings, in the world.

What compensates for motion is clear for every pair of an observation and a track: with ``LastVelocity`` the
observation's own velocity, as the paper has it; where that is unknown, the track's, which its past centres tell; and
nothing where the track was seen but once.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float64
from torch import Tensor

from most.errors import ConfigError
from most.tracking.live import Live, Sightings

SETTLE = 0.5  # s over which velocities told by centres are averaged, since modal centres jump as the view changes
SHORTEST = 0.05  # s; centres jump, so what they do in less would tell absurd velocities: it is divided by this instead
FASTEST = 10.0  # m/s, standard deviation of a velocity that nothing tells yet


@runtime_checkable
class Motion(Protocol):
    """A model of motion."""

    memory: int  # numbers that it keeps for each track

    def velocities(self, seen: Sightings, tracks: Live) -> Float64[Tensor, "segments tracks 3"]:
        """Return how fast each observation would have moved since it was each track's last one, m/s."""
        ...

    def start(self, seen: Sightings) -> tuple[Float64[Tensor, "segments 3"], Float64[Tensor, "segments kept"]]:
        """Return velocities and memories of new tracks."""
        ...

    def update(
        self, tracks: Live, seen: Sightings, since: Float64[Tensor, "tracks"]
    ) -> tuple[Float64[Tensor, "tracks 3"], Float64[Tensor, "tracks 3"], Float64[Tensor, "tracks kept"]]:
        """Return centres, velocities and memories of tracks seen again, row by row, ``since`` seconds later."""
        ...


@dataclass
class LastVelocity:
    """Tracks are where they were last seen, with the velocity observed there or else told by the way there."""

    compensate: bool = True  # no: nearest centres, whatever moves

    memory = 0

    def velocities(self, seen: Sightings, tracks: Live) -> Float64[Tensor, "segments tracks 3"]:
        """Return the observation's velocity, or the track's where that is unknown."""
        known = seen.velocity_known[:, None, None]
        return torch.where(known, seen.velocities[:, None], tracks.velocities[None]) * self.compensate

    def start(self, seen: Sightings) -> tuple[Float64[Tensor, "segments 3"], Float64[Tensor, "segments 0"]]:
        """Return the observed velocities, 0 where they are unknown."""
        return _known_or(seen, torch.zeros_like(seen.velocities)), seen.centres[:, :0]

    def update(
        self, tracks: Live, seen: Sightings, since: Float64[Tensor, "tracks"]
    ) -> tuple[Float64[Tensor, "tracks 3"], Float64[Tensor, "tracks 3"], Float64[Tensor, "tracks 0"]]:
        """Return the new centres with their velocities; those that the centres tell settle exponentially."""
        told = (seen.centres - tracks.centres) / since.clamp(min=SHORTEST)[:, None]
        weight = torch.where(tracks.hits == 1, 1.0, 1 - torch.exp(-since / SETTLE))
        settled = tracks.velocities + weight[:, None] * (told - tracks.velocities)
        return seen.centres, _known_or(seen, settled), tracks.memory


@dataclass
class ConstantVelocity:
    """A Kalman filter: constant velocity but for white noise; centres are measured, velocities where they are known.

    Noise is the same along all axes, so these share one covariance of position and velocity, three numbers a track.
    """

    acceleration: float = 3.0  # m/s after a second, standard deviation
    centre: float = 0.3  # m, standard deviation of observed centres
    velocity: float = 1.0  # m/s, of observed velocities

    memory = 3  # variance of position, covariance, variance of velocity

    def __post_init__(self) -> None:
        for key in ("acceleration", "centre", "velocity"):
            if not 0 < getattr(self, key) < float("inf"):
                raise ConfigError(f"tracker.kalman.{key}: expected a number above 0, found {getattr(self, key)}")

    def velocities(self, seen: Sightings, tracks: Live) -> Float64[Tensor, "segments tracks 3"]:
        """Return the tracks' filtered velocities."""
        return tracks.velocities.expand(len(seen), -1, -1)

    def start(self, seen: Sightings) -> tuple[Float64[Tensor, "segments 3"], Float64[Tensor, "segments 3"]]:
        """Return what the first observation tells."""
        speed = torch.where(seen.velocity_known, self.velocity**2, FASTEST**2).double()
        position = torch.full_like(speed, self.centre**2)
        memory = torch.stack([position, torch.zeros_like(speed), speed], 1)
        return _known_or(seen, torch.zeros_like(seen.velocities)), memory

    def update(
        self, tracks: Live, seen: Sightings, since: Float64[Tensor, "tracks"]
    ) -> tuple[Float64[Tensor, "tracks 3"], Float64[Tensor, "tracks 3"], Float64[Tensor, "tracks 3"]]:
        """Predict, then correct by the centre, then by the velocity."""
        (pp, pv, vv), noise = tracks.memory.T, self.acceleration**2
        pp = pp + since * (2 * pv + since * vv) + noise * since**3 / 3
        pv = pv + since * vv + noise * since**2 / 2
        vv = vv + noise * since
        position, speed = tracks.centres + tracks.velocities * since[:, None], tracks.velocities
        error, total = seen.centres - position, pp + self.centre**2
        position, speed = position + (pp / total)[:, None] * error, speed + (pv / total)[:, None] * error
        pp, pv, vv = pp - pp * pp / total, pv - pp * pv / total, vv - pv * pv / total
        error, total = seen.velocities - speed, vv + self.velocity**2
        gain = torch.stack([pv, vv]) / total * seen.velocity_known  # 0: an unknown velocity corrects nothing
        error = torch.where(seen.velocity_known[:, None], error, 0.0)
        position, speed = position + gain[0][:, None] * error, speed + gain[1][:, None] * error
        return position, speed, torch.stack([pp - gain[0] * pv, pv - gain[0] * vv, vv - gain[1] * vv], 1)


def _known_or(seen: Sightings, other: Float64[Tensor, "rows 3"]) -> Float64[Tensor, "rows 3"]:
    return torch.where(seen.velocity_known[:, None], seen.velocities, other)
