"""Who is on the street: parked rows, lanes of traffic, persons in groups, bicycles in racks, riders."""

from collections.abc import Callable, Iterator

import numpy as np

from most.simulation.actors import Actor, Path
from most.simulation.mesh import Mesh
from most.simulation.people import bicycle, bicyclist, motorcycle, motorcyclist, stander, walker
from most.simulation.settings import TrafficSettings
from most.simulation.street import Street
from most.simulation.vehicles import bus, car, truck, van

EGO_GAP = 13.0  # m that the lane of the sensor is kept free before and behind it


def populate(street: Street, traffic: TrafficSettings, speed: float, rng: np.random.Generator) -> list[Actor]:
    """All things; ``speed`` (m/s) is the sensor's, and that of its lane."""
    actors: list[Actor] = []
    for side in (-1, 1):
        actors += _parked(street, side, traffic, rng)
        actors += _bicycles(street, side, traffic, rng)
        actors += _persons(street, side, traffic, rng)
        actors += _bicyclists(street, side, traffic, rng)
        for lane in range(street.lanes):
            own = side < 0 and lane == street.lanes - 1
            actors += _driving(street, side, lane, traffic, speed if own else rng.uniform(5, 12), own, rng)
    return actors


def _gain(rng: np.random.Generator) -> float:
    """Brightness of a paint or a cloth relative to the average."""
    return float(rng.choice([0.25, 0.6, 1.0, 1.5]) * rng.uniform(0.8, 1.2))


def _vehicle(
    trucks: float, rare: bool, busses: bool, rng: np.random.Generator
) -> tuple[int, Callable[[np.random.Generator], Mesh]]:
    """Raw class and maker of a vehicle: a truck by the share given, sometimes a van or a bus, else a car."""
    draw = rng.random()
    if draw < trucks:
        return (13, bus) if busses and rare and rng.random() < 0.2 else (18, truck)
    return (20, van) if rare and draw > 0.97 else (10, car)


def _spread(street: Street, rate: float, rng: np.random.Generator) -> Iterator[float]:
    """Places s, ``rate`` in 100 m on one side of the street, one in each of as many equal stretches."""
    count = int(rate * (street.end - street.start) / 200 + rng.random())
    stretch = (street.end - street.start) / max(count, 1)
    for k in range(count):
        yield street.start + (k + rng.uniform(0.1, 0.9)) * stretch


def _parked(street: Street, side: int, traffic: TrafficSettings, rng: np.random.Generator) -> Iterator[Actor]:
    parking, slant = street.sides[side].parking, street.sides[side].slant
    trucks = 0.0 if slant else traffic.parked_trucks
    s = street.start + rng.uniform(0, 5)
    while parking and s < street.end:
        label, make = _vehicle(trucks, traffic.rare and not slant, False, rng)
        mesh = make(rng)
        size = np.ptp(mesh.vertices, axis=0)
        length = float((size[1] + 0.6) / np.sin(slant) if slant else size[0])  # taken of the kerb
        middle = s + length / 2
        if rng.random() < traffic.parked and not street.crosses(middle, length / 2 + 4):
            d = side * (street.carriageway + parking / 2 + rng.normal(0, 0.08))
            facing = (0.0 if side < 0 else np.pi) + slant + rng.normal(0, 0.025)
            yield Actor(label, Path(middle, d, facing=facing), [mesh], _gain(rng))
        s += length + 0.35 + rng.exponential(0.5)


def _driving(
    street: Street, side: int, lane: int, traffic: TrafficSettings, speed: float, own: bool, rng: np.random.Generator
) -> Iterator[Actor]:
    d = side * street.lane_width * (lane + 0.5)
    spacing = 100 * 2 * street.lanes / max(traffic.driving, 0.1)
    s = street.start + rng.exponential(spacing)
    while s < street.end and traffic.driving:
        label, make = _vehicle(traffic.driving_trucks, traffic.rare, True, rng)
        mesh = make(rng)
        half = float(np.ptp(mesh.vertices[:, 0])) / 2
        if not own or abs(s) > EGO_GAP + half:
            facing = 0.0 if side < 0 else np.pi
            path = Path(s, d + rng.normal(0, 0.15), along=-side * speed, facing=facing)
            yield Actor(label, path, [mesh], _gain(rng))
        s += 2 * half + 7 + rng.exponential(spacing)


def _bicyclists(street: Street, side: int, traffic: TrafficSettings, rng: np.random.Generator) -> Iterator[Actor]:
    speed, facing = -side * float(rng.uniform(3, 6)), 0.0 if side < 0 else np.pi
    for s in _spread(street, traffic.bicyclists, rng):
        path = Path(s, side * (street.carriageway - 0.6), along=speed, facing=facing)
        if traffic.rare and rng.random() < 0.15:
            yield Actor(32, path, [motorcyclist()], _gain(rng))
        else:
            yield Actor(31, path, bicyclist(), _gain(rng), cycles=1.1, start=float(rng.random()))


def _persons(street: Street, side: int, traffic: TrafficSettings, rng: np.random.Generator) -> Iterator[Actor]:
    """Groups of one to four on the sidewalk; all walkers of a side go one way, so that nobody walks through another."""
    profile = street.sides[side]
    inner = street.carriageway + profile.parking + profile.verge
    way, pace = int(rng.choice([-1, 1])), float(rng.uniform(1.0, 1.6))
    facing = 0.0 if way > 0 else np.pi
    for s in _spread(street, traffic.persons / 1.9, rng):  # 1.9: the mean size of a group
        walks = rng.random() < 0.7
        for k in range(int(rng.choice([1, 1, 2, 2, 3, 4], p=[0.3, 0.15, 0.2, 0.2, 0.1, 0.05]))):
            d = side * (inner + 0.9 + 0.72 * (k % 2) + rng.normal(0, 0.05))
            at = s + 0.75 * (k // 2) + rng.normal(0, 0.12)
            height, gain = float(rng.uniform(1.5, 1.92)), _gain(rng)
            if walks:
                path = Path(at, d, along=way * pace, facing=facing)
                yield Actor(30, path, walker(height), gain, cycles=pace / 1.5, start=float(rng.random()))
            else:
                yield Actor(30, Path(at, d, facing=rng.uniform(0, 6.28)), [stander(height)], gain)


def _bicycles(street: Street, side: int, traffic: TrafficSettings, rng: np.random.Generator) -> Iterator[Actor]:
    """Racks of one to four along the outer edge of the sidewalk."""
    profile = street.sides[side]
    d = side * (street.carriageway + profile.parking + profile.verge + profile.sidewalk - 0.45)
    for s in _spread(street, traffic.bicycles / 2.0, rng):  # 2.0: the mean size of a rack
        if street.crosses(s, 4):
            continue
        slant = rng.uniform(0.0, 1.2)
        for k in range(int(rng.choice([1, 2, 3, 4], p=[0.4, 0.3, 0.2, 0.1]))):
            facing = slant + rng.normal(0, 0.05)
            spacing = 0.65 if slant > 0.6 else 1.9
            path = Path(s + k * spacing, d, facing=facing)
            if traffic.rare and rng.random() < 0.2:
                yield Actor(15, path, [motorcycle()], _gain(rng))
            else:
                yield Actor(11, path, [bicycle()], _gain(rng))
