import math

import pytest
import torch

from most.errors import ConfigError
from most.modal.heatmap import HeatmapTargets, draw_heatmap, gaussian_radius


def draw(peaks, variances, shape=(1, 9, 7)):
    planes, cells = (
        torch.tensor([p[0] for p in peaks]),
        torch.tensor([p[1:] for p in peaks], dtype=torch.int64).reshape(-1, 2),
    )
    return draw_heatmap(planes.long(), cells, torch.tensor(variances).reshape(-1, 2), shape)


def test_a_peak_is_exactly_one_and_falls_off_per_axis():
    heatmap = draw([(0, 4, 3)], [(1.0, 4.0)])
    assert heatmap[0, 4, 3] == 1
    assert heatmap[0, 5, 3].item() == pytest.approx(math.exp(-1 / 2))
    assert heatmap[0, 4, 5].item() == pytest.approx(math.exp(-4 / 8))
    assert heatmap[0, 3, 1].item() == pytest.approx(math.exp(-1 / 2 - 4 / 8))


def test_it_is_cut_at_the_border():
    heatmap = draw([(0, 0, 6)], [(1.0, 1.0)])
    assert heatmap[0, 0, 6] == 1
    assert heatmap[0, 1, 5].item() == pytest.approx(math.exp(-1))
    assert heatmap[0, 8].max() == 0


def test_the_higher_one_wins_where_two_overlap():
    together = draw([(0, 2, 3), (0, 5, 3)], [(2.0, 2.0), (1.0, 1.0)])
    apart = torch.maximum(draw([(0, 2, 3)], [(2.0, 2.0)]), draw([(0, 5, 3)], [(1.0, 1.0)]))
    assert torch.equal(together, apart)


def test_planes_do_not_touch():
    heatmap = draw([(1, 4, 3)], [(9.0, 9.0)], (3, 9, 7))
    assert heatmap[[0, 2]].max() == 0


def test_a_gaussian_does_not_depend_on_its_neighbours_size():
    alone, beside = (
        draw([(0, 4, 3)], [(1.0, 1.0)], (2, 30, 30)),
        draw([(0, 4, 3), (1, 20, 20)], [(1.0, 1.0), (9.0, 9.0)], (2, 30, 30)),
    )
    assert torch.equal(alone[0], beside[0])


def test_no_peaks_make_an_empty_map():
    assert draw([], []).sum() == 0


def test_variance_is_the_half_extent_in_cells_and_at_least_one():
    sizes = torch.tensor([[3.5, 0.2]])
    assert HeatmapTargets().variances(sizes).tolist() == [[3.5, 1.0]]
    assert HeatmapTargets(min_variance=4.0).variances(sizes).tolist() == [[4.0, 4.0]]


def test_gaussian_radius_is_centre_points():
    # An overlap of 0.1: CenterPoint takes min(5.71, 10.53, 1.73) for 4 x 4 cells and, third again, 5.29 for 20 x 8.
    sizes = torch.tensor([[4.0, 4.0], [20.0, 8.0]])
    third = [(-1.6 + math.sqrt(2.56 + 4 * 0.4 * 14.4)) / 2, (-5.6 + math.sqrt(5.6**2 + 4 * 0.4 * 144)) / 2]
    assert gaussian_radius(sizes, 0.1).tolist() == pytest.approx(third)
    small, large = HeatmapTargets(kind="gaussian_radius").variances(sizes / 2).tolist()
    assert small == pytest.approx([(5 / 6) ** 2] * 2)  # radius 2, the least
    assert large == pytest.approx([(11 / 6) ** 2] * 2)  # radius 5


@pytest.mark.parametrize(
    ("key", "value"),
    [("kind", "round"), ("min_variance", 0.0), ("min_overlap", 1.0), ("min_radius", -1), ("min_points", 0)],
)
def test_settings_out_of_range_are_refused(key, value):
    with pytest.raises(ConfigError, match=rf"stage\.detection\.targets\.{key}: expected .*, found {value!r}"):
        HeatmapTargets(**{key: value})
