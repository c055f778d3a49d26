"""Identities over time, one sweep after the other (paper, section III, modal panoptic tracking)."""

import math
from collections.abc import Mapping

import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from most.errors import DataError, check_kept
from most.structures import Observations, Tracks
from most.tracking.assignment import Assignment
from most.tracking.live import Live, Sightings, canonical_order
from most.tracking.motion import Motion
from most.tracking.numbers import Numbers

HALF_SECOND = 0.5  # that gates are given for; none is narrower, since modal centres jump however short the time is
CLOCK = 1e-3  # s by which times of scans are off


class Tracker:
    """Follows the things of one sequence; what it says of a sweep depends on no later one.

    Nothing depends on the order of observations, but between equal ones. Memory grows with the live tracks, and the
    numbers of dead ones, which are as many as labels have room for at most.
    """

    def __init__(
        self, gates: list[float], numbers: Numbers, assignment: Assignment, motion: Motion, lost_after: float
    ) -> None:
        """``gates``: by class, m in half a second; tracks not seen for more than ``lost_after`` seconds end."""
        self.gates, self.assignment, self.motion, self.lost_after = gates, assignment, motion, lost_after
        self._numbers = numbers
        self._live = Live.none(motion.memory)
        self._pose, self._time = torch.eye(4, dtype=torch.float64), -math.inf

    def step(
        self, seen: Observations, pose: Float64[Tensor, "4 4"] | None, time: float
    ) -> Int64[Tensor, "observations"]:
        """Return the track identity of each observation of the next sweep.

        ``pose`` is world_from_sensor, ``time`` in seconds on any clock. Sweeps may be missing. Without a pose the
        last one holds: the sensor frame is the world where there never was one, and a stream that loses its poses is
        taken to stand still. An observation that is nowhere has a number for this sweep alone, and no track. A sweep
        that comes late, or what is not finite, is a DataError that changes nothing:
        the sweep may be left out, and the next one goes on.
        """
        self.check(pose, time)
        if not bool(seen.centres[seen.placed].isfinite().all() & seen.velocities[seen.velocity_known].isfinite().all()):
            raise DataError(f"sweep at {time} s: expected finite centres and velocities, found others; leave them out")
        self._pose, self._time = self._pose if pose is None else pose.cpu().clone(), time
        self._forget()
        if not len(seen):
            return torch.empty_like(seen.classes)
        local = seen.to("cpu")
        order, numbers = canonical_order(local), torch.empty_like(local.classes)
        placed, nowhere = order[local.placed[order]], order[~local.placed[order]]
        numbers[placed] = self._follow(Sightings.of(local.select(placed), self._pose))
        numbers[nowhere] = self._number_once(local.classes[nowhere])
        return numbers.to(seen.classes.device)

    def tracks(self) -> Tracks:
        """Return the live tracks, those out of sight too, in the frame and at the time of the last sweep."""
        return self._live.in_sensor(self._pose, self._time)

    def state(self) -> dict[str, Tensor]:
        """Return all that later sweeps depend on, in plain tensors."""
        given, free = self._numbers.state()
        clock = torch.tensor(self._time, dtype=torch.float64)
        live = {name: value.clone() for name, value in vars(self._live).items()}
        return live | {"pose": self._pose.clone(), "time": clock, "given": given, "free": free}

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Go on from the ``state`` of a tracker of the same settings; a DataError for another's changes nothing."""
        if state["memory"].shape[1:] != (self.motion.memory,):
            raise DataError("tracks: expected the state of a tracker of the same motion, found another's")
        live, pose, time = Live.kept(state, self.motion.memory), state["pose"], float(state["time"])
        check_kept("pose", pose, self._pose, 4)
        if math.isnan(time) or not bool(pose.isfinite().all()):
            raise DataError(f"state: expected a finite pose and a time, found {pose.tolist()} at {time} s")
        if len(live) and not 0 <= int(live.classes.min()) <= int(live.classes.max()) < len(self.gates):
            raise DataError(
                f"tracks: expected classes up to {len(self.gates) - 1}, found others; they are of another dataset"
            )
        self._numbers.restore((state["given"], state["free"]))
        self._live, self._pose, self._time = live, pose.clone(), time

    def check(self, pose: Float64[Tensor, "4 4"] | None, time: float) -> None:
        """Raise the DataError that ``step`` would, were it told this pose and time next."""
        if not (math.isfinite(time) and time > self._time):
            raise DataError(
                f"sweep at {time} s: expected a time after the last sweep's {self._time} s; leave late sweeps out, "
                "and begin a sequence with a new tracker"
            )
        if pose is not None and not bool(pose.isfinite().all()):
            raise DataError(f"sweep at {time} s: expected a finite pose, found {pose.tolist()}; leave it out, or None")

    def _forget(self) -> None:
        """End the tracks that are lost."""
        keep = self._time - self._live.last_seen <= self.lost_after + CLOCK
        if not keep.all():
            dead, self._live = self._live.select(~keep), self._live.select(keep)
            self._numbers.release(_named(dead), _named(self._live))

    def _follow(self, seen: Sightings) -> Int64[Tensor, "observations"]:
        """Continue the tracks that are seen again, begin one with each other observation; return their numbers."""
        track = self._associate(seen)
        again, new = (track >= 0).nonzero().squeeze(1), (track < 0).nonzero().squeeze(1)
        self._continue(track[again], seen.select(again))
        numbers = torch.empty_like(track)
        numbers[again] = self._live.numbers[track[again]]
        numbers[new] = self._begin(seen.select(new))
        return numbers

    def _number_once(self, classes: Int64[Tensor, "observations"]) -> Int64[Tensor, "observations"]:
        """Return numbers that nothing else in this sweep has, and take them back at once."""
        numbers = torch.tensor([self._numbers.take(thing) for thing in classes.tolist()], dtype=torch.int64)
        self._numbers.release(zip(classes.tolist(), numbers.tolist(), strict=True), _named(self._live))
        return numbers

    def _associate(self, seen: Sightings) -> Int64[Tensor, "observations"]:
        """Return the live track that each observation continues, -1 for none."""
        track = torch.full((len(seen),), -1)
        for thing in seen.classes.unique().tolist():
            rows = (seen.classes == thing).nonzero().squeeze(1)
            columns = (self._live.classes == thing).nonzero().squeeze(1)
            distance, gates = self._distances(seen.select(rows), self._live.select(columns), self.gates[thing])
            scores = seen.scores[rows].numpy()
            for row, column in self.assignment(distance.numpy(), gates.numpy(), scores):
                track[rows[row]] = columns[column]
        return track

    def _distances(
        self, seen: Sightings, tracks: Live, gate: float
    ) -> tuple[Float64[Tensor, "observations tracks"], Float64[Tensor, "tracks"]]:
        """Return distances over ground, as the sensor's x-y plane has it, without motion since; and gates, m."""
        since = self._time - tracks.last_seen
        moved = self.motion.velocities(seen, tracks) * since[:, None]
        away = (seen.centres[:, None] - moved - tracks.centres) @ self._pose[:3, :2]
        return away.norm(dim=2), gate * (since / HALF_SECOND).clamp(min=1)

    def _continue(self, track: Int64[Tensor, "again"], seen: Sightings) -> None:
        before = self._live.select(track)
        centres, velocities, memory = self.motion.update(before, seen, self._time - before.last_seen)
        changes = {"centres": centres, "velocities": velocities, "memory": memory, "extents": seen.extents}
        changes |= {"hits": before.hits + 1, "last_seen": torch.full_like(before.last_seen, self._time)}
        for name, value in changes.items():
            getattr(self._live, name)[track] = value

    def _begin(self, seen: Sightings) -> Int64[Tensor, "new"]:
        """Add a track for each observation; return their numbers."""
        numbers = torch.tensor([self._numbers.take(thing) for thing in seen.classes.tolist()], dtype=torch.int64)
        velocities, memory = self.motion.start(seen)
        now = torch.full((len(seen),), self._time, dtype=torch.float64)
        born = Live(
            numbers=numbers,
            classes=seen.classes,
            centres=seen.centres,
            velocities=velocities,
            extents=seen.extents,
            hits=torch.ones_like(numbers),
            first_seen=now,
            last_seen=now,
            memory=memory,
        )
        self._live = Live.cat([self._live, born])
        return numbers


def _named(tracks: Live) -> list[tuple[int, int]]:
    return list(zip(tracks.classes.tolist(), tracks.numbers.tolist(), strict=True))
