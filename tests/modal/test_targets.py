import math
from dataclasses import replace

import pytest
import torch

from most.modal.heatmap import HeatmapTargets
from most.modal.targets import bev_targets
from most.structures import Instances

CAR, PERSON = 1, 5


def instance(x, y, z=-1.0, of=CAR, points=10, extent=(2.0, 1.0, 0.5), velocity=None):
    return Instances(
        keys=torch.tensor([1]),
        classes=torch.tensor([of]),
        counts=torch.tensor([points]),
        centres=torch.tensor([[x, y, z]]),
        extents=torch.tensor([extent]),
        velocities=torch.tensor([velocity or (0.0, 0.0)]),
        velocity_known=torch.tensor([velocity is not None]),
    )


def scene(*parts):
    return Instances.cat(list(parts))


def targets(*samples, **settings):
    """Targets on 20 x 10 cells of 0.5 x 1 m from (-5, -5) on."""
    return bev_targets(list(samples), (-5.0, -5.0), (0.5, 1.0), (20, 10), [CAR, PERSON], HeatmapTargets(**settings))


def test_a_centre_worked_by_hand():
    found = targets(scene(instance(0.1, 0.75, velocity=(3.0, -4.0))))
    # (5.1 / 0.5, 5.75 / 1) = (10.2, 5.75): cell 10, 5; from its middle at 10.5, 5.5: -0.3, 0.25
    assert found.cells.tolist() == [[0, 10, 5]]
    assert found.offset[0].tolist() == pytest.approx([-0.3, 0.25], abs=1e-5)
    assert found.height.tolist() == [[-1.0]]
    assert found.extent[0].tolist() == pytest.approx([math.log(2), 0, math.log(0.5)])
    assert found.velocity.tolist() == [[3, -4]]
    assert found.velocity_known.tolist() == [True]
    assert found.heatmap.shape == (1, 2, 20, 10)
    assert found.heatmap[0, 0, 10, 5] == 1
    assert found.heatmap[0, 0, 12, 5].item() == pytest.approx(math.exp(-4 / (2 * 4)))  # 2 m are 4 cells along x
    assert found.heatmap[0, 0, 10, 6].item() == pytest.approx(math.exp(-1 / 2))
    assert found.heatmap[0, 1].max() == 0


def test_class_and_sample_choose_the_plane():
    found = targets(scene(instance(0.0, 0.0)), scene(instance(1.0, 0.0, of=PERSON), instance(-2.0, 2.0)))
    peaks = sorted(torch.nonzero(found.heatmap == 1).tolist())
    assert peaks == [[0, 0, 10, 5], [1, 0, 6, 7], [1, 1, 12, 5]]
    assert sorted(found.cells.tolist()) == [[0, 10, 5], [1, 6, 7], [1, 12, 5]]


def test_centres_beyond_the_grid_are_left_out():
    found = targets(scene(instance(5.01, 0.0), instance(0.0, -5.01), instance(-5.0, 4.99)))
    assert found.cells.tolist() == [[0, 0, 9]]
    assert (found.heatmap == 1).sum() == 1


def test_other_classes_and_small_instances_are_left_out():
    found = targets(
        scene(instance(0.0, 0.0, points=2), instance(2.0, 0.0, points=3), instance(3.0, 0.0, of=9)), min_points=3
    )
    assert found.cells.tolist() == [[0, 14, 5]]


def test_of_two_in_one_cell_the_one_with_more_points_is_regressed():
    few, many = instance(0.1, 0.5, z=1.0, points=3), instance(0.2, 0.5, z=2.0, of=PERSON, points=9)
    for order in ((few, many), (many, few)):
        found = targets(scene(*order))
        assert found.height.tolist() == [[2.0]]
        assert torch.nonzero(found.heatmap == 1).tolist() == [[0, 0, 10, 5], [0, 1, 10, 5]]


def test_samples_without_instances():
    nothing = instance(0.0, 0.0).select(torch.tensor([False]))
    found = targets(nothing, nothing)
    assert found.heatmap.shape == (2, 2, 20, 10)
    assert found.heatmap.sum() == 0
    assert found.cells.shape == (0, 3)
    assert found.extent.shape == (0, 3)


def test_a_turned_box_has_sine_and_cosine_of_twice_its_yaw_and_a_heat_map_about_what_it_reaches():
    """Half-sizes 4 and 0.5 m at a right angle: 1 cell of 0.5 m along x, 4 of 1 m along y."""
    turned = instance(0.1, 0.5, extent=(4.0, 0.5, 1.0))
    assert targets(turned).yaw is None
    found = targets(replace(turned, yaws=torch.tensor([math.pi / 2])))
    assert found.yaw[0].tolist() == pytest.approx([0.0, -1.0], abs=1e-6)
    assert found.extent[0].tolist() == pytest.approx([math.log(4), math.log(0.5), 0])
    assert found.heatmap[0, 0, 11, 5].item() == pytest.approx(math.exp(-1 / 2), abs=1e-5)
    assert found.heatmap[0, 0, 10, 7].item() == pytest.approx(math.exp(-4 / (2 * 4)), abs=1e-5)


def test_half_a_turn_asks_for_the_same():
    one, other = (targets(replace(instance(0, 0), yaws=torch.tensor([yaw]))).yaw for yaw in (0.4, 0.4 - math.pi))
    assert torch.allclose(one, other, atol=1e-6)
