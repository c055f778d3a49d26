import math

import pytest
import torch

from most.detections import PeakDetector
from most.errors import ConfigError
from most.structures import BevMaps
from most.voxels import BevGrid

GRID = BevGrid(lower=(-4.0, -4.0), cell=(1.0, 1.0), shape=(8, 8))


def maps(*peaks, things=2, batch=1):
    """Empty maps with peaks (window, channel, x, y, probability)."""
    made = BevMaps(*[torch.zeros(batch, channels, 8, 8) for channels in (things, 2, 1, 3, 2)])
    made.heatmap.fill_(-9.0)
    for window, channel, x, y, probability in peaks:
        made.heatmap[window, channel, x, y] = math.log(probability / (1 - probability))
    return made


def test_a_peak_is_decoded_by_hand():
    given = maps((0, 1, 5, 2, 0.9))
    given.offset[0, :, 5, 2] = torch.tensor([0.25, -0.5])
    given.height[0, 0, 5, 2] = -1.5
    given.extent[0, :, 5, 2] = torch.tensor([2.0, 1.0, 0.5]).log()
    given.velocity[0, :, 5, 2] = torch.tensor([3.0, -1.0])
    (found,) = PeakDetector()(given, [4, 6], GRID)
    assert found.classes.tolist() == [6]
    assert found.scores.tolist() == pytest.approx([0.9])
    assert torch.allclose(found.centres, torch.tensor([[1.75, -2.0, -1.5]]))
    assert torch.allclose(found.extents, torch.tensor([[2.0, 1.0, 0.5]]))
    assert torch.allclose(found.velocities, torch.tensor([[3.0, -1.0]]))


def test_only_the_highest_of_a_neighbourhood_stays_and_the_most_confident_comes_first():
    (found,) = PeakDetector(overlap=0.0)(maps((0, 0, 1, 1, 0.5), (0, 0, 1, 2, 0.6), (0, 0, 6, 6, 0.8)), [1, 2], GRID)
    assert found.scores.tolist() == pytest.approx([0.8, 0.6])


def test_a_weaker_centre_inside_a_box_of_its_class_goes_and_one_of_another_class_stays():
    given = maps((0, 0, 2, 2, 0.9), (0, 0, 2, 4, 0.5), (0, 1, 2, 4, 0.4))
    given.extent[0, :, 2, 2] = math.log(5.0)
    (found,) = PeakDetector(overlap=0.5)(given, [1, 2], GRID)
    assert found.classes.tolist() == [1, 2]


def test_a_suppressed_centre_suppresses_nobody():
    given = maps((0, 0, 0, 1, 0.9), (0, 0, 2, 1, 0.8), (0, 0, 4, 1, 0.7))
    given.extent[0] = math.log(5.0)
    (found,) = PeakDetector(overlap=0.5)(given, [1, 2], GRID)
    assert found.scores.tolist() == pytest.approx([0.9, 0.7])


def test_windows_of_a_batch_are_apart():
    first, second = PeakDetector()(maps((1, 0, 3, 3, 0.9), batch=2), [1, 2], GRID)
    assert (len(first), len(second)) == (0, 1)


@pytest.mark.parametrize("wrong", [{"window": 2}, {"threshold": 1.0}, {"most": 0}, {"overlap": -1.0}])
def test_impossible_settings_are_refused(wrong):
    with pytest.raises(ConfigError, match=rf"detector.{next(iter(wrong))}: expected"):
        PeakDetector(**wrong)


def turned(*peaks, yaw, size):
    """Maps with peaks whose boxes have this yaw and these half-sizes."""
    made = maps(*peaks)
    made.extent[0] = torch.tensor(size).log()[:, None, None]
    made.yaw = torch.tensor([math.sin(2 * yaw), math.cos(2 * yaw)])[None, :, None, None].expand(1, 2, 8, 8)
    return made


@pytest.mark.parametrize("yaw", [-1.5, -0.7, 0.0, 0.3, 1.5])
def test_a_yaw_is_half_the_angle_of_its_sine_and_cosine(yaw):
    peak = (0, 0, 5, 2, 0.9)
    for angle in (yaw, yaw + math.pi):  # back to front it is the same box
        (found,) = PeakDetector()(turned(peak, yaw=angle, size=(2.0, 1.0, 1.0)), [1, 2], GRID)
        assert found.yaws.tolist() == pytest.approx([yaw], abs=1e-5)


def test_what_lies_along_a_turned_box_goes_and_what_lies_beside_it_stays():
    """Boxes 8 m long and 1 m wide at 45 degrees: two cells aside on one diagonal are inside, on the other outside."""
    peaks = (0, 0, 3, 3, 0.9), (0, 0, 5, 5, 0.8), (0, 0, 5, 1, 0.7)
    (found,) = PeakDetector(overlap=1.0)(turned(*peaks, yaw=math.pi / 4, size=(4.0, 0.5, 1.0)), [1, 2], GRID)
    assert found.scores.tolist() == pytest.approx([0.9, 0.7])


@pytest.mark.parametrize(("second", "kept"), [(0.0, 2), (math.pi / 2, 1)])
def test_a_box_across_another_reaches_over_it(second, kept):
    """Boxes 8 m by 1 m, two cells apart across the first: beside each other, or the second over the first."""
    crossing = turned((0, 0, 3, 3, 0.9), (0, 0, 3, 5, 0.8), yaw=0.0, size=(4.0, 0.5, 1.0))
    crossing.yaw = crossing.yaw.clone()
    crossing.yaw[0, :, 3, 5] = torch.tensor([math.sin(2 * second), math.cos(2 * second)])
    (found,) = PeakDetector(overlap=1.0)(crossing, [1, 2], GRID)
    assert len(found) == kept
