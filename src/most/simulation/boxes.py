"""The amodal boxes of a sequence: the full extent of every thing in every scan, seen or not."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int64

from most.simulation.world import Scan, World


@dataclass
class Boxes:
    """One row a thing and scan, world frame (the frame of the sensor poses Tr^-1 P Tr); z is up.

    A point p lies in a box where abs(R(yaw)^T (p - centre)) <= half_size.
    """

    scan: Int64[np.ndarray, "boxes"]
    instance: Int64[np.ndarray, "boxes"]  # upper 16 bits of the points' labels
    label: Int64[np.ndarray, "boxes"]  # raw class, lower 16 bits
    centre: Float[np.ndarray, "boxes 3"]  # m
    half_size: Float[np.ndarray, "boxes 3"]  # m: along, across, up
    yaw: Float[np.ndarray, "boxes"]  # radians from the world's x axis
    velocity: Float[np.ndarray, "boxes 2"]  # m/s
    points: Int64[np.ndarray, "boxes"]  # how many the scan has on it


def boxes(world: World, scans: list[Scan]) -> Boxes:
    """Boxes of the things within the sensor's range."""
    rows = [_row(world, scan, index, thing) for index, scan in enumerate(scans) for thing in _near(world, scan)]
    columns = zip(*rows, strict=True) if rows else [[] for _ in range(8)]
    kinds = [(int, ()), (int, ()), (int, ()), (float, (3,)), (float, (3,)), (float, ()), (float, (2,)), (int, ())]
    return Boxes(*(np.array(c, k).reshape(-1, *tail) for c, (k, tail) in zip(columns, kinds, strict=True)))


def _near(world: World, scan: Scan) -> list[int]:
    reach = world.settings.sensor.max_range
    centres = [actor.centre(world.street, scan.time) for actor in world.actors]
    return [k for k, centre in enumerate(centres) if np.linalg.norm(centre - scan.pose[:3, 3]) < reach]


def _row(world: World, scan: Scan, index: int, thing: int) -> tuple[object, ...]:
    actor, street = world.actors[thing], world.street
    half = 0.5 * (actor.high - actor.low)
    yaw, centre = actor.path.place(street, scan.time)[1], actor.centre(street, scan.time)
    count = int((scan.labels == world.label(thing)).sum())
    return index, thing + 1, actor.raw_class, centre, half, yaw, actor.velocity(street, scan.time), count
