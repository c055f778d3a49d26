import numpy as np
import pytest

from most.errors import ConfigError
from most.simulation import SensorSettings, SimulationSettings, TrafficSettings
from most.simulation.scene import Hits
from most.simulation.sensor import directions, elevations, measure


def _hits(count: int, distance: float, reflectivity: float = 0.5, gloss: float = 0.5) -> Hits:
    ones = np.ones(count, np.float32)
    label = np.full(count, 3 << 16 | 10, np.uint32)
    return Hits(distance * ones, label, reflectivity * ones, ones, gloss * ones)


def _ahead(count: int) -> np.ndarray:
    return np.tile([1.0, 0, 0], (count, 1))


def test_beams_of_both_sensors():
    kitti = np.degrees(elevations(SensorSettings()))
    assert len(kitti) == 64
    assert (kitti[0], kitti[-1]) == (pytest.approx(2.0), pytest.approx(-24.33))
    assert kitti[:-1] - kitti[1:] == pytest.approx([1 / 3] * 31 + [0.5] * 32, abs=0.01)
    nuscenes = elevations(SensorSettings(fan_lowest=[-30.67], fan_highest=[10.67], fan_beams=[32]))
    assert np.degrees(nuscenes[:-1] - nuscenes[1:]) == pytest.approx([4 / 3] * 31, abs=0.01)


def test_rays_are_unit_vectors_all_around():
    rays = directions(SensorSettings(fan_lowest=[0.0], fan_highest=[0.0], fan_beams=[1], columns=8), 0.0)
    assert rays[[0, 2, 4]] == pytest.approx(np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0]]))
    assert np.linalg.norm(directions(SensorSettings(columns=8), 0.3), axis=1) == pytest.approx(1)


def test_range_noise_and_drop_out_are_as_told():
    sensor, n = SensorSettings(range_noise=0.05, drop_out=0.2), 20_000
    points, labels = measure(_hits(n, 10.0), _ahead(n), sensor, np.random.default_rng(0))
    assert len(points) == len(labels) == pytest.approx(0.8 * n, rel=0.03)
    assert points[:, 0].mean() == pytest.approx(10, abs=0.002)
    assert points[:, 0].std() == pytest.approx(0.05, rel=0.03)
    assert points[:, 3].min() >= 0
    assert points[:, 3].max() < 1


def test_dark_glossy_and_far_surfaces_return_less():
    n, rng = 5_000, np.random.default_rng(0)
    slant = _hits(n, 10.0, 0.05, gloss=3.0)
    slant.cosine = np.full(n, 0.5, np.float32)
    cases = [_hits(n, 10.0), _hits(n, 45.0, 0.1), _hits(n, 45.0, 0.02), slant]
    counts = [len(measure(hits, _ahead(n), SensorSettings(), rng)[0]) for hits in cases]
    assert counts[0] > counts[1] > counts[2] > 0
    assert counts[0] > counts[3]


def test_nothing_beyond_the_range_and_no_labels_beyond_the_labelled_one():
    sensor = SensorSettings(range_noise=0.0, drop_out=0.0, max_range=80.0, labelled_range=50.0)
    hits = _hits(4, 1.0, reflectivity=100.0)
    hits.distance = np.array([49.0, 51.0, 81.0, np.inf], np.float32)
    points, labels = measure(hits, _ahead(4), sensor, np.random.default_rng(0))
    assert points[:, 0].tolist() == [49.0, 51.0]
    assert labels.tolist() == [3 << 16 | 10, 0]


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: SensorSettings(fan_beams=[32]), "simulation.sensor.fan_beams"),
        (lambda: SensorSettings(drop_out=1.0), "simulation.sensor.drop_out"),
        (lambda: TrafficSettings(parked=1.5), "simulation.traffic.parked"),
        (lambda: SimulationSettings(sequences=["7"]), "simulation.sequences"),
        (lambda: SimulationSettings(sequences=["07", "07"]), "simulation.sequences"),
        (lambda: SimulationSettings(scans=0), "simulation.scans"),
    ],
)
def test_settings_out_of_range_name_their_key(make, key):
    with pytest.raises(ConfigError, match=key + ": expected .*, found "):
        make()
