"""What a tracker works with: observations and live tracks, both in the world, in float64."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor

from most.errors import check_kept
from most.geometry.poses import invert, transform
from most.structures import Observations, Rows, Tracks


@dataclass
class Sightings(Rows):
    """Observations in the world."""

    classes: Int64[Tensor, "segments"]
    centres: Float64[Tensor, "segments 3"]  # m
    velocities: Float64[Tensor, "segments 3"]  # m/s
    velocity_known: Bool[Tensor, "segments"]
    extents: Float[Tensor, "segments 3"]  # half-sizes along the axes of the sensor, m
    scores: Float[Tensor, "segments"]

    @staticmethod
    def of(seen: Observations, pose: Float64[Tensor, "4 4"]) -> "Sightings":
        """Move observations by world_from_sensor; they are taken to move in the sensor's x-y plane."""
        return Sightings(
            classes=seen.classes,
            centres=transform(pose, seen.centres.double()),
            velocities=seen.velocities.double() @ pose[:3, :2].T,
            velocity_known=seen.velocity_known,
            extents=seen.extents,
            scores=seen.scores,
        )


@dataclass
class Live(Rows):
    """Tracks that may still be seen again, as they were last seen, in the order of their births."""

    numbers: Int64[Tensor, "tracks"]
    classes: Int64[Tensor, "tracks"]
    centres: Float64[Tensor, "tracks 3"]  # m, world
    velocities: Float64[Tensor, "tracks 3"]  # m/s, world; 0 where nothing tells it yet
    extents: Float[Tensor, "tracks 3"]  # half-sizes along the axes of the sensor that saw it, m
    hits: Int64[Tensor, "tracks"]
    first_seen: Float64[Tensor, "tracks"]  # s
    last_seen: Float64[Tensor, "tracks"]
    memory: Float64[Tensor, "tracks kept"]  # what the model of motion keeps

    @staticmethod
    def none(memory: int) -> "Live":
        """No tracks."""
        whole, real = torch.zeros(0, dtype=torch.int64), torch.zeros(0, dtype=torch.float64)
        rows, kept = torch.zeros(0, 3, dtype=torch.float64), torch.zeros(0, memory, dtype=torch.float64)
        return Live(whole, whole, rows, rows, rows.float(), whole, real, real, kept)

    @staticmethod
    def kept(state: Mapping[str, Any], memory: int) -> "Live":
        """Read the tracks that a state holds; a DataError where they are none, or of another model of motion."""
        like, numbers = Live.none(memory), state["numbers"]
        for name, column in vars(like).items():
            check_kept(name, state[name], column, len(numbers))
        return Live(**{name: state[name].clone() for name in vars(like)})

    def in_sensor(self, pose: Float64[Tensor, "4 4"], time: float) -> Tracks:
        """Return where the tracks are expected at a time, in the frame of a sensor (world_from_sensor)."""
        expected = self.centres + self.velocities * (time - self.last_seen)[:, None]
        return Tracks(
            ids=self.numbers.clone(),
            classes=self.classes.clone(),
            centres=transform(invert(pose), expected).float(),
            extents=self.extents.clone(),
            velocities=(self.velocities @ pose[:3, :2]).float(),
            hits=self.hits.clone(),
            first_seen=self.first_seen.clone(),
            last_seen=self.last_seen.clone(),
        )


def canonical_order(seen: Observations) -> Int64[Tensor, "segments"]:
    """Sort observations by all that they say, so that the order they came in decides between equal ones alone."""
    numbers = torch.cat([seen.scores[:, None], seen.centres, seen.velocities, seen.extents], 1).double().numpy()
    columns = [seen.classes.numpy(), -numbers[:, 0], *numbers[:, 1:].T]
    return torch.from_numpy(np.lexsort(columns[::-1]))
