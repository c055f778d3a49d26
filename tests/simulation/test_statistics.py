"""Simulated streets against the real scans; the same statistics of both."""

import os
from pathlib import Path

import numpy as np
import pytest
from scan_statistics import scan_statistics

from most.simulation import SensorSettings, SimulationSettings
from most.simulation.world import World

REAL = os.environ.get("MOST_REAL_DATA")
SEEDS, SEQUENCES = 3, 20  # one scan of each street: streets differ, the scans of one street hardly do


def _real_scans():
    for path in sorted((Path(REAL) / "semantickitti" / "sequences").glob("*/velodyne/*.bin")):
        labels = path.parents[1] / "labels" / path.with_suffix(".label").name
        yield np.fromfile(path, np.float32).reshape(-1, 4), np.fromfile(labels, np.uint32)


def _simulated_scans():
    sensor = SensorSettings(max_range=52.0)  # labels end at 50 m
    for seed in range(SEEDS):
        for sequence in range(SEQUENCES):
            scan = World(SimulationSettings(scans=1, seed=seed, sensor=sensor), f"{sequence:02d}").scan(0)
            yield scan.points, scan.labels


def test_contested_and_counted_by_hand():
    """Two cars whose boxes overlap by one point, a lone person; of stuff and of things without an instance nothing."""
    car = np.array([[9, 0, 0], [11, 1, 1], [10, 0.5, 0.5]])
    other = np.array([[10.5, 0.5, 0.5], [13, 2, 0.9]])
    lone = np.array([[20.0, 5, 0], [40, 0, 0], [19, -5, 0]])
    far = np.array([[20.0, 0, 0], [40.0, 9, 0]])
    points = np.concatenate([car, other, lone, far])
    labels = np.array([1 << 16 | 10] * 3 + [2 << 16 | 252] * 2 + [3 << 16 | 30, 40, 10, 4 << 16 | 10, 5 << 16 | 10])
    found = scan_statistics([(points, labels.astype(np.uint32))])
    assert found["instances_a_scan"] == 5
    assert found["points_per_car_at_10_m"] == (3 + 2) / 2  # centres at 10 and 11.8 m
    assert found["points_per_car_at_40_m"] == 1
    assert found["share_below_50_points"] == 1
    assert found["share_contested"] == 1 / 5  # the first car's box holds the second's first point, not the reverse


@pytest.mark.real
@pytest.mark.skipif(REAL is None, reason="MOST_REAL_DATA is not set")
def test_streets_are_like_the_real_ones():
    real, simulated = scan_statistics(_real_scans()), scan_statistics(_simulated_scans())
    ratio = {key: simulated[key] / real[key] for key in real}
    contested = ratio.pop("share_contested")
    assert {key: value for key, value in ratio.items() if not 0.7 <= value <= 1.3} == {}, ratio
    assert 0.5 <= contested <= 2.0
