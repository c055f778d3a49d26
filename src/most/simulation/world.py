"""One sequence's world: a street with all that stands and moves on it, and the sensor driving through."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, UInt32

from most.simulation.actors import Actor
from most.simulation.ground import ground
from most.simulation.mesh import Mesh, rotation
from most.simulation.population import populate
from most.simulation.roadside import roadside
from most.simulation.scene import Hits, Scene
from most.simulation.sensor import directions, measure
from most.simulation.settings import SimulationSettings
from most.simulation.street import Street


@dataclass
class Scan:
    """What the sensor saw at one time, and the truth about it."""

    points: Float[np.ndarray, "points 4"]  # x, y, z (m, sensor frame), intensity
    labels: UInt32[np.ndarray, "points"]  # instance << 16 | raw class
    pose: Float[np.ndarray, "4 4"]  # world from sensor
    time: float  # s


class World:
    """Everything of one sequence, drawn from (seed, sequence) alone; instance k + 1 is ``actors[k]``."""

    def __init__(self, settings: SimulationSettings, sequence: str) -> None:
        self.settings, self.key = settings, (settings.seed, int(sequence.removeprefix("scene-")))
        rng = np.random.default_rng([*self.key, 0])
        self.speed = settings.speed * float(rng.uniform(0.6, 1.4))
        drive = self.speed * settings.period * settings.scans
        self.street = Street(drive, settings.sensor.max_range, rng)
        self.actors = populate(self.street, settings.traffic, self.speed, rng)
        rare = settings.traffic.rare
        self._scenery = [ground(self.street, rare, rng), *roadside(self.street, rare, rng)]
        self._gains = [1.0, *rng.uniform(0.5, 1.6, len(self._scenery) - 1)]

    def label(self, index: int) -> int:
        """Whole raw label of ``actors[index]``."""
        return (index + 1) << 16 | self.actors[index].raw_class

    def placed(self, actor: Actor, time: float) -> Mesh:
        """An actor's mesh in the world frame."""
        return actor.mesh(time).moved(*actor.path.place(self.street, time))

    def _scene(self, indices: list[int], time: float, scenery: list[Mesh], gains: list[float]) -> Scene:
        meshes = [self.placed(self.actors[index], time) for index in indices]
        labels = [self.label(index) for index in indices]
        paints = [self.actors[index].gain for index in indices]
        return Scene(scenery + meshes, [0] * len(scenery) + labels, gains + paints)

    @cached_property
    def _still(self) -> Scene:
        """All that never moves, built once."""
        indices = [index for index, actor in enumerate(self.actors) if not actor.moves]
        return self._scene(indices, 0.0, self._scenery, self._gains)

    def pose(self, time: float) -> Float[np.ndarray, "4 4"]:
        """World from sensor: in the middle of the right lane, leaning with the ground."""
        s, lane = self.speed * time, -self.street.lane_width * (self.street.lanes - 0.5)
        d = lane + 0.15 * np.sin(0.15 * s)
        foot = self.street.position(s, d)
        yaw = float(self.street.heading(s)) + np.arctan(0.15 * 0.15 * np.cos(0.15 * s))
        forward = rotation(yaw)[:, 0]
        grade = self.street.hills(foot[:2] + forward[:2]) - self.street.hills(foot[:2] - forward[:2])
        pitch = -np.arctan(grade / 2) + 0.004 * np.sin(6.0 * time)
        c, s_ = np.cos(pitch), np.sin(pitch)
        pose = np.eye(4)
        pose[:3, :3] = rotation(yaw) @ np.array([[c, 0, s_], [0, 1, 0], [-s_, 0, c]])
        pose[:3, 3] = foot + pose[:3, 2] * self.settings.sensor.height
        return pose

    def cast(self, pose: Float[np.ndarray, "4 4"], rays: Float[np.ndarray, "rays 3"], time: float) -> Hits:
        """First hits of rays given in the sensor frame."""
        origin, way = pose[:3, 3], rays @ pose[:3, :3].T
        hits = self._still.cast(origin, way)
        reach = self.settings.sensor.max_range + 10
        near = [
            index
            for index, actor in enumerate(self.actors)
            if actor.moves and np.linalg.norm(actor.path.place(self.street, time)[0] - origin) < reach
        ]
        return hits.nearer(self._scene(near, time, [], []).cast(origin, way)) if near else hits

    def scan(self, index: int) -> Scan:
        """Scan ``index``; its noise comes from (seed, sequence, index) alone."""
        rng = np.random.default_rng([*self.key, 1, index])
        time, sensor = index * self.settings.period, self.settings.sensor
        pose, rays = self.pose(time), directions(sensor, rng.random())
        points, labels = measure(self.cast(pose, rays, time), rays, sensor, rng)
        return Scan(points, labels, pose, time)
