"""Facts about the real scans of sequence 04 that a wrong key or a wrong extent would break."""

import os
from pathlib import Path

import numpy as np
import pytest
import torch

from most.modal.build import LabelRules, build_table
from most.modal.extent import ShrinkWrap, TrackMax
from most.structures import Sweep

FOLDER = Path(os.environ.get("MOST_REAL_DATA", "")) / "semantickitti" / "sequences" / "04"
CARS = torch.tensor([10, 252])
EYE, ZERO = torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64)

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif("MOST_REAL_DATA" not in os.environ, reason="MOST_REAL_DATA is not set"),
]


@pytest.fixture(scope="module")
def table():
    rules = LabelRules(
        to_training=lambda raw: torch.isin(raw & 0xFFFF, CARS).long(),
        is_thing=lambda classes: classes == 1,
        instance_of=lambda raw: raw >> 16,
    )
    return build_table([read(index) for index in range(10)], rules)


def read(index: int) -> Sweep:
    """A scan with an identity pose: only keys and sizes matter here."""
    points = np.fromfile(FOLDER / "velodyne" / f"{index:06d}.bin", np.float32).reshape(-1, 4)
    labels = np.fromfile(FOLDER / "labels" / f"{index:06d}.label", np.uint32).astype(np.int64)
    eye = torch.eye(4, dtype=torch.float64)
    return Sweep("04", index, torch.from_numpy(points), eye, index / 10, torch.from_numpy(labels))


def test_static_and_moving_cars_of_one_id_are_two_cars(table):
    static, moving = (table.centres[table.keys == (raw | 5 << 16)] for raw in (10, 252))
    assert len(static)
    assert len(moving)
    assert torch.cdist(static, moving).min() > 4  # m: further apart than one car could be from itself


def test_no_car_is_longer_than_a_car(table):
    for index in table.frames.tolist():
        for strategy in (ShrinkWrap(), TrackMax()):
            assert table.instances(index, strategy, EYE, ZERO).extents.max() < 6
