"""What a simulation is told: the sensor's beams, how busy the street is, and which sequences to make."""

import re
from dataclasses import dataclass, field

from most.errors import ConfigError


def _expect(key: str, holds: bool, expected: str, found: object) -> None:
    if not holds:
        raise ConfigError(f"simulation.{key}: expected {expected}, found {found!r}")


@dataclass(frozen=True)
class Layout:
    """What a dataset's own tree asks of a simulation."""

    period: float  # s between scans
    name: str  # pattern of a sequence's name
    names: str  # the same in words


LAYOUTS = {
    "semantickitti": Layout(0.1, "[0-9]{2}", 'names of two digits, quoted in YAML ("07")'),
    "nuscenes": Layout(0.05, "scene-[0-9]{4}", "names such as scene-0061"),
}


@dataclass
class SensorSettings:
    """A spinning lidar: fans of evenly spaced beams, and what it gets wrong. The default is KITTI's 64-beam sensor."""

    fan_lowest: list[float] = field(default_factory=lambda: [-24.33, -8.33])  # degrees, one number a fan
    fan_highest: list[float] = field(default_factory=lambda: [-8.83, 2.0])  # degrees
    fan_beams: list[int] = field(default_factory=lambda: [32, 32])
    columns: int = 2048  # firings a revolution
    height: float = 1.73  # m above the road
    max_range: float = 80.0  # m
    labelled_range: float = 50.0  # m on the ground; SemanticKITTI's points beyond are unlabelled
    range_noise: float = 0.02  # m, standard deviation
    drop_out: float = 0.03  # share of the returns that are lost for no visible reason

    def __post_init__(self) -> None:
        sizes = {len(self.fan_lowest), len(self.fan_highest), len(self.fan_beams)}
        _expect("sensor.fan_beams", len(sizes) == 1 and sizes != {0}, "as many as fan_lowest, fan_highest", sizes)
        _expect("sensor.fan_beams", min(self.fan_beams) > 0, "positive counts", self.fan_beams)
        degrees = [*self.fan_lowest, *self.fan_highest]
        _expect("sensor.fan_lowest", all(-90 < angle < 90 for angle in degrees), "degrees in (-90, 90)", degrees)
        _expect("sensor.columns", self.columns >= 8, "at least 8", self.columns)
        _expect("sensor.height", 0.3 <= self.height <= 5, "metres in [0.3, 5]", self.height)
        _expect("sensor.max_range", 10 <= self.max_range <= 200, "metres in [10, 200]", self.max_range)
        _expect("sensor.labelled_range", self.labelled_range > 0, "metres above 0", self.labelled_range)
        _expect("sensor.range_noise", 0 <= self.range_noise <= 0.2, "metres in [0, 0.2]", self.range_noise)
        _expect("sensor.drop_out", 0 <= self.drop_out < 1, "a share in [0, 1)", self.drop_out)


@dataclass
class TrafficSettings:
    """How busy the street is: numbers per 100 m of street, both sides together, unless said otherwise."""

    parked: float = 0.33  # share of the kerb's parking space that is taken, where a side has any
    parked_trucks: float = 0.06  # share of the parked vehicles
    driving: float = 2.5  # cars and trucks on the move
    driving_trucks: float = 0.1  # share of the vehicles on the move
    persons: float = 2.5
    bicycles: float = 0.7  # parked
    bicyclists: float = 0.5  # riding
    rare: bool = True  # also vans, buses, motorcycles, parking areas, fences, signs and bins

    def __post_init__(self) -> None:
        for key in ("parked", "parked_trucks", "driving_trucks"):
            _expect(f"traffic.{key}", 0 <= getattr(self, key) <= 1, "a share in [0, 1]", getattr(self, key))
        for key in ("driving", "persons", "bicycles", "bicyclists"):
            _expect(f"traffic.{key}", 0 <= getattr(self, key) <= 100, "a number in [0, 100]", getattr(self, key))


@dataclass
class SimulationSettings:
    """Which sequences to make, of which street, seen by which sensor, and written in which layout."""

    sequences: list[str] = field(default_factory=lambda: ["00", "01", "02", "08"])
    scans: int = 10  # of each sequence
    seed: int = 0
    speed: float = 8.0  # of the sensor, m/s; each sequence drives at 0.6 to 1.4 times that
    sensor: SensorSettings = field(default_factory=SensorSettings)
    traffic: TrafficSettings = field(default_factory=TrafficSettings)
    every: int = 1  # so many revolutions of the sensor for a scan: 10 shows an instance from many sides in few scans
    layout: str = "semantickitti"  # or nuscenes; it sets the time between scans, too

    def __post_init__(self) -> None:
        _expect("layout", self.layout in LAYOUTS, f"one of {', '.join(LAYOUTS)}", self.layout)
        layout = LAYOUTS[self.layout]
        named = all(isinstance(name, str) and re.fullmatch(layout.name, name) for name in self.sequences)
        _expect("sequences", named, f"{layout.names} in the layout {self.layout}", self.sequences)
        unique = len(set(self.sequences)) == len(self.sequences) > 0
        _expect("sequences", unique, "each name once, at least one", self.sequences)
        _expect("scans", 1 <= self.scans <= 10_000, "a number in [1, 10000]", self.scans)
        _expect("every", 1 <= self.every <= 100, "a number in [1, 100]", self.every)
        keyed = self.layout == "nuscenes"  # its key frames are so many sweeps apart
        _expect("every", not keyed or self.every == 1, "1 in the layout nuscenes", self.every)
        _expect("seed", self.seed >= 0, "0 or more", self.seed)
        _expect("speed", 0 <= self.speed <= 40, "m/s in [0, 40]", self.speed)

    @property
    def period(self) -> float:
        """Time between scans, s."""
        return LAYOUTS[self.layout].period * self.every
