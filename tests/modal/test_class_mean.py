"""CWM: what is too small along an axis is as large as its class is on average in the training split."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from most.errors import ConfigError
from most.geometry.poses import yaw
from most.modal.build import LabelRules, build_table
from most.modal.class_mean import ClassMean, KnownMeans, sensor_half_sizes
from most.modal.extent import ShrinkWrap
from most.modal.instances import InstanceTable, turn
from most.structures import Sweep

CAR, OTHER_CAR, FLAT_CAR, PERSON = 1 | 5 << 16, 1 | 6 << 16, 1 | 7 << 16, 2 | 8 << 16
EYE, ZERO = torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64)
LARGE = [[8, 1, 0], [12, 1, 0], [8, -1, 0], [12, -1, 1.0]]  # half-sizes 2, 1, 0.75
SMALL = [[20, 0, 0], [22, 0, 0], [21, 0.02, 0], [21, -0.02, 0]]  # 1, 0.02, 0


def one_point() -> InstanceTable:
    """A car of one point."""
    rules = LabelRules(lambda raw: raw & 0xFFFF, lambda classes: classes > 0, lambda raw: raw >> 16)
    pose = torch.eye(4, dtype=torch.float64)
    return build_table([Sweep("00", 0, torch.zeros(1, 4), pose, 0.0, torch.tensor([CAR]))], rules)


@pytest.fixture
def training(rules, sweep_of):
    """A large car whose scan is turned in the world, and a small one in the next scan."""
    return [build_table([sweep_of({CAR: LARGE}, yaw=1.0), sweep_of({OTHER_CAR: SMALL}, index=1)], rules)]


@pytest.fixture
def seen(rules, sweep_of):
    """A car of one point, a flat one, and a person of one point."""
    sweep = {CAR: [[5, 5, 0]], FLAT_CAR: SMALL, PERSON: [[9, 9, 0]]}
    return build_table([sweep_of(sweep, yaw=0.3)], rules)


def test_means_are_of_what_is_not_too_small_along_the_sensors_axes(training):
    (means,) = ClassMean().build(training).means.values()
    assert means == pytest.approx([1.5, 1.0, 0.75], abs=1e-6)


def test_each_axis_is_replaced_by_itself_and_a_class_without_mean_stays(training, seen):
    found = seen.instances(0, ClassMean().build(training), EYE, ZERO)
    expected = [[1.5, 1.0, 0.75], [1.0, 1.0, 0.75], [0.05, 0.05, 0.05]]
    assert torch.allclose(found.extents, torch.tensor(expected), atol=1e-6)
    assert found.yaws is None


def test_a_larger_setting_replaces_more(training, seen):
    found = seen.instances(0, ClassMean(smallest=1.2).build(training), EYE, ZERO)
    assert torch.allclose(found.extents[1], torch.tensor([2.0, 0.05, 0.05]), atol=1e-6)  # only one half-size is above


@given(st.floats(0.5, 2.0), st.integers(0, 3), st.sampled_from([1.0, -1.0]))
def test_means_follow_scale_flips_and_quarter_turns_exactly(scale, quarters, flip):
    """An axis that is turned onto another takes its mean along."""
    linear = torch.eye(3, dtype=torch.float64)
    linear[:2, :2] = turn(torch.tensor(quarters * math.pi / 2, dtype=torch.float64))
    linear = scale * linear @ torch.diag(torch.tensor([flip, 1.0, 1.0], dtype=torch.float64))
    strategy, table = KnownMeans({1: [1.5, 1.0, 0.75]}, 0.06, 0.01), one_point()
    expected = torch.tensor([1.5, 1.0, 0.75] if quarters % 2 == 0 else [1.0, 1.5, 0.75]) * scale
    assert torch.allclose(table.instances(0, strategy, linear, ZERO).extents[0], expected, atol=1e-5)


def test_what_is_too_small_is_the_same_in_a_scaled_window(seen):
    """0.02 m are replaced and 1 m stay, however the window is scaled."""
    strategy = KnownMeans({1: [1.5, 1.0, 0.75]}, 0.06, 0.001)
    for scale in (0.05, 1.0, 20.0):
        extents = seen.instances(0, strategy, scale * EYE, ZERO).extents[1]
        assert torch.allclose(extents, scale * torch.tensor([1.0, 1.0, 0.75]), rtol=1e-4)


def test_half_sizes_in_the_sensors_frame_are_those_of_an_unchanged_window(training):
    (table,) = training
    sizes = torch.cat([table.instances(int(index), ShrinkWrap(1e-9), EYE, ZERO).extents for index in table.frames])
    assert torch.allclose(sensor_half_sizes(table).float(), sizes, atol=1e-6)
    assert yaw(table.poses)[0] == pytest.approx(1.0)


def test_no_tables_no_means():
    assert ClassMean().build([]).means == {}


@pytest.mark.parametrize(("setting", "message"), [("smallest", "metres >= 0"), ("floor", "a length above 0 m")])
def test_negative_lengths_are_refused(setting, message):
    with pytest.raises(ConfigError, match=rf"extent\.{setting}: expected {message}, found -1"):
        ClassMean(**{setting: -1.0})
