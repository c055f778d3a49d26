"""Persons on foot, two-wheelers, and persons on two-wheelers.

What moves its limbs is a list of meshes, the frames of one cycle. All of them are made once and shared: persons differ
by a scale.
"""

from functools import cache

import numpy as np

from most.simulation.mesh import Mesh, chain, ellipsoid, merge, tube
from most.simulation.surfaces import Surface

_CYCLE = np.linspace(0, 2 * np.pi, 20, endpoint=False)  # phases of a cycle's frames
_HEIGHT = 1.75  # m, of a person before scaling


@cache
def _walk() -> list[Mesh]:
    return [_person(0.32, phase) for phase in _CYCLE]


def walker(height: float) -> list[Mesh]:
    """Frames of a double step of somebody ``height`` m tall."""
    return [mesh.scaled(height / _HEIGHT) for mesh in _walk()]


@cache
def _standing() -> Mesh:
    return _person(0.0, 0.0)


def stander(height: float) -> Mesh:
    """Somebody ``height`` m tall who stands still."""
    return _standing().scaled(height / _HEIGHT)


def _person(stride: float, phase: float) -> Mesh:
    """A person in mid-step; ``stride`` (m) is how far a foot swings."""
    height = _HEIGHT
    hip, shoulder, swing = 0.50 * height, 0.82 * height, stride * np.sin(phase)
    parts = [_torso(np.array([0.0, 0.0, hip - 0.05]), np.array([0.03, 0.0, shoulder]))]
    for side in (-1, 1):
        foot, y = side * swing, side * 0.10
        knee = (0.5 * foot + 0.08 * abs(np.sin(phase)), y, 0.27 * height)
        parts.append(chain([(0, y, hip), knee, (foot, y, 0.06)], 0.085, Surface.CLOTH, 5))
        parts.append(tube((foot - 0.08, y, 0.05), (foot + 0.18, y, 0.05), 0.05, Surface.TYRE, 5))
        hand = (-0.7 * side * swing + 0.08, side * 0.30, 0.45 * height)
        elbow = (-0.3 * side * swing - 0.04, side * 0.28, 0.62 * height)
        parts.append(chain([(0.03, side * 0.22, shoulder - 0.05), elbow, hand], 0.055, Surface.CLOTH, 4))
    parts.append(ellipsoid((0.05, 0, height - 0.13), (0.11, 0.09, 0.13), Surface.SKIN))
    return merge(parts)


def _torso(low: np.ndarray, high: np.ndarray) -> Mesh:
    """A trunk from the hips to the shoulders, with a neck."""
    lean = high - low
    middle = ellipsoid(low + 0.5 * lean, (0.15, 0.21, 0.62 * float(np.linalg.norm(lean))), Surface.CLOTH)
    neck = tube(high - 0.05 * lean, high + 0.16 * lean, 0.06, Surface.SKIN, 6)
    return merge([middle, tube(low, high, 0.16, Surface.CLOTH, 8, taper=1.15), neck])


def _wheel(x: float, radius: float, thickness: float) -> Mesh:
    turn = np.linspace(0, 2 * np.pi, 11)
    rim = [(x + radius * np.cos(a), 0.0, radius + thickness + radius * np.sin(a)) for a in turn]
    spokes = [chain([rim[i], rim[i + 5]], 0.45 * thickness, Surface.TUBE, 3) for i in (0, 2, 4)]
    return merge([chain(rim, thickness, Surface.TYRE, 3), *spokes])


@cache
def bicycle() -> Mesh:
    """Two wheels, a frame of tubes, handlebar, saddle; tubes as thick as a lidar's beam makes them look."""
    head, seat, crank = (0.38, 0.0, 0.86), (-0.20, 0.0, 0.88), (-0.03, 0.0, 0.32)
    rear, front = (-0.53, 0.0, 0.37), (0.55, 0.0, 0.37)
    tubes = [(rear, seat), (rear, crank), (seat, crank), (seat, head), (crank, head), (head, front)]
    parts = [_wheel(-0.53, 0.33, 0.035), _wheel(0.55, 0.33, 0.035)]
    parts += [chain(ends, 0.03, Surface.TUBE) for ends in tubes]
    parts.append(chain([(0.42, -0.28, 1.02), (0.36, 0, 1.0), (0.42, 0.28, 1.02)], 0.03, Surface.TUBE))
    parts.append(tube(head, (0.36, 0, 1.0), 0.03, Surface.TUBE, 5))
    parts.append(ellipsoid((-0.24, 0, 0.94), (0.15, 0.08, 0.05), Surface.TYRE, 0))
    return merge(parts)


@cache
def motorcycle() -> Mesh:
    """Two fat wheels, engine, tank, seat, fork and handlebar."""
    parts = [_wheel(-0.70, 0.25, 0.075), _wheel(0.72, 0.25, 0.075)]
    parts.append(ellipsoid((0.0, 0, 0.45), (0.42, 0.20, 0.25), Surface.TYRE))
    parts.append(ellipsoid((0.18, 0, 0.85), (0.35, 0.20, 0.18), Surface.PAINT))
    parts.append(ellipsoid((-0.42, 0, 0.80), (0.45, 0.17, 0.12), Surface.TYRE))
    parts.append(chain([(0.72, 0, 0.33), (0.48, 0, 1.0), (0.35, 0, 1.1)], 0.06, Surface.TUBE, 5))
    parts.append(tube((0.38, -0.38, 1.08), (0.38, 0.38, 1.08), 0.03, Surface.TUBE, 5))
    parts.append(ellipsoid((0.55, 0, 0.98), (0.15, 0.18, 0.17), Surface.GLASS, 0))
    return merge(parts)


@cache
def bicyclist() -> list[Mesh]:
    """Frames of one turn of the pedals of a person on a bicycle."""
    hip, hand = np.array([-0.22, 0.0, 0.95]), np.array([0.42, 0.28, 1.04])
    return [merge([bicycle(), _rider(phase, 0.17, hip, hand)]) for phase in _CYCLE]


@cache
def motorcyclist() -> Mesh:
    """A person on a motorcycle."""
    return merge([motorcycle(), _rider(0.5, 0.05, np.array([-0.25, 0.0, 0.90]), np.array([0.38, 0.34, 1.10]))])


def _rider(phase: float, crank: float, hip: np.ndarray, hand: np.ndarray) -> Mesh:
    """A seated person whose feet go round the crank and whose hands hold the bar."""
    shoulder = hip + np.array([0.28, 0.0, 0.52])
    head = ellipsoid(shoulder + np.array([0.10, 0, 0.24]), (0.13, 0.10, 0.14), Surface.SKIN)
    parts = [_torso(hip, shoulder), head]
    for side in (-1, 1):
        angle = phase + (np.pi if side > 0 else 0)
        foot = np.array([-0.03 + crank * np.cos(angle), side * 0.13, 0.36 + crank * np.sin(angle)])
        knee = 0.5 * (hip + foot) + np.array([0.22, side * 0.04, 0.10])
        parts.append(chain([hip + np.array([0, side * 0.10, 0]), knee, foot], 0.08, Surface.CLOTH, 5))
        grip, joint = hand * (1, side, 1), shoulder + np.array([0, side * 0.2, -0.03])
        elbow = 0.5 * (shoulder + grip) + np.array([-0.05, side * 0.10, -0.05])
        parts.append(chain([joint, elbow, grip], 0.055, Surface.CLOTH, 4))
    return merge(parts)
