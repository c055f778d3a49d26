"""The lidar: which way its beams look, and which of the hits come back as points."""

import numpy as np
from jaxtyping import Float, UInt32

from most.simulation.scene import Hits
from most.simulation.settings import SensorSettings

_FULL = 20.0  # m up to which the optics make up for the distance; the signal falls with its square beyond
_THRESHOLD = 0.035  # signal of which 1 - 1/e are detected


def elevations(sensor: SensorSettings) -> Float[np.ndarray, "beams"]:
    """Elevation of every beam, radians, highest first."""
    fans = zip(sensor.fan_lowest, sensor.fan_highest, sensor.fan_beams, strict=True)
    return np.sort(np.radians(np.concatenate([np.linspace(*fan) for fan in fans])))[::-1]


def directions(sensor: SensorSettings, phase: float) -> Float[np.ndarray, "rays 3"]:
    """Unit vectors in the sensor frame, beam by beam; ``phase`` in [0, 1) shifts them by that share of a column."""
    up = elevations(sensor)[:, None]
    around = 2 * np.pi * (np.arange(sensor.columns) + phase)[None, :] / sensor.columns
    x, y = np.cos(up) * np.cos(around), np.cos(up) * np.sin(around)
    return np.stack([x, y, np.broadcast_to(np.sin(up), x.shape)], -1).reshape(-1, 3)


def measure(
    hits: Hits, rays: Float[np.ndarray, "rays 3"], sensor: SensorSettings, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "points 4"], UInt32[np.ndarray, "points"]]:
    """Points (x, y, z in m, sensor frame; intensity in [0, 1]) and labels of the rays whose light came back.

    A return is the surer the brighter the surface, the steeper the incidence and the nearer the hit, so that glass,
    dark paint and the road at a grazing angle fade out with range, as they do in real scans.
    """
    signal = hits.reflectivity * hits.cosine**hits.gloss * np.minimum(_FULL / np.maximum(hits.distance, 1.0), 1.0) ** 2
    seen = rng.random(len(rays)) < (1 - sensor.drop_out) * -np.expm1(-signal / _THRESHOLD)
    seen &= hits.distance < sensor.max_range
    distance = hits.distance[seen] + rng.normal(0, sensor.range_noise, seen.sum())
    brightness = hits.reflectivity[seen] * (0.4 + 0.6 * hits.cosine[seen]) + rng.normal(0, 0.03, seen.sum())
    intensity = np.round(np.clip(brightness, 0, 0.99), 2)
    points = np.concatenate([rays[seen] * distance[:, None], intensity[:, None]], 1)
    labelled = np.hypot(points[:, 0], points[:, 1]) < sensor.labelled_range
    return points.astype(np.float32), np.where(labelled, hits.label[seen], np.uint32(0))
