import math

import pytest
import torch

from most.errors import ConfigError
from most.modal.build import build_table
from most.modal.extent import DropSmall, ShrinkWrap, TrackMax

CAR = 1 | 5 << 16
EYE, ZERO = torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64)


@pytest.fixture
def table(rules, sweep_of):
    """A car 4 m long seen whole, then its rear bumper alone, then one point, the sensor turned left by 90 degrees."""
    whole = [[8, 1, 0], [12, 1, 0], [8, -1, 0], [12, -1, 1.0]]
    bumper = [[1, 8, 0], [-1, 8, 0]]
    return build_table(
        [
            sweep_of({CAR: whole}),
            sweep_of({CAR: bumper}, index=1, yaw=math.pi / 2),
            sweep_of({CAR: bumper[:1]}, index=2),
        ],
        rules,
    )


def extents(table, index, strategy):
    return [round(value, 6) for value in table.instances(index, strategy, EYE, ZERO).extents[0].tolist()]


def test_shrink_wrap_knows_one_frame(table):
    assert extents(table, 0, ShrinkWrap()) == [2, 1, 0.75]
    assert extents(table, 1, ShrinkWrap()) == [1, 0.05, 0.05]
    assert extents(table, 2, ShrinkWrap(floor=0.1)) == [0.1, 0.1, 0.1]


def test_track_max_knows_them_all_in_world_directions(table):
    assert extents(table, 0, TrackMax()) == [2, 1, 0.75]
    assert extents(table, 1, TrackMax()) == [1, 2, 0.75]  # the world's x lies along the turned sensor's -y
    assert extents(table, 2, TrackMax()) == [2, 1, 0.75]


@pytest.mark.parametrize("strategy", [ShrinkWrap, TrackMax, DropSmall])
def test_a_floor_must_be_positive(strategy):
    with pytest.raises(ConfigError, match=r"extent\.floor: expected a length above 0 m, found 0"):
        strategy(floor=0.0)


def test_drop_small_is_shrink_wrap_for_what_is_left(table):
    for index in range(3):
        assert extents(table, index, DropSmall()) == extents(table, index, ShrinkWrap())
    with pytest.raises(ConfigError, match=r"extent\.min_points: expected a number of at least 1, found 0"):
        DropSmall(min_points=0)
