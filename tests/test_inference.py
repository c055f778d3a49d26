"""From the network's output to labels: every point gets one, also where the network saw nothing."""

import math

import pytest
import torch
from torch import nn

from most.inference import Inference, Predictor
from most.membership import Nearest
from most.network import Network, NetworkOutput, is_current
from most.structures import BevMaps
from most.voxels import BevGrid, voxelise
from tiny import CAR, GRID, PERSON, ROAD, TAXONOMY, cloud, street, tiny_predictor, window

FALLBACK = TAXONOMY.stuff[0]


class LeftAndRight(Network):
    """Stands for a trained network: left of the sensor (y > 0) all is car, right of it road; one car at (2.5, 3)."""

    def __init__(self):
        nn.Module.__init__(self)
        self.grid = GRID

    @property
    def bev_grid(self):
        return BevGrid((-8.0, -8.0), (4.0, 4.0), (4, 4))

    def forward(self, samples):
        voxels = voxelise(samples, GRID)
        left = voxels.coordinates[:, 2] >= 16
        logits = torch.zeros(len(voxels), TAXONOMY.num_classes - 1)
        logits[left, CAR - 1], logits[~left, ROAD - 1] = 1.0, 1.0
        current = is_current(samples)[voxels.inputs].nonzero().squeeze(1)
        nothing = torch.zeros(len(samples), 8, 4, 4)
        return NetworkOutput(
            voxels, self.maps(len(samples)), current, logits, logits[voxels.point_voxel[current]],
            torch.zeros(len(voxels.inputs), 4), nothing,
        )  # fmt: skip

    def maps(self, batch):
        made = BevMaps(*[torch.zeros(batch, channels, 4, 4) for channels in (len(TAXONOMY.things), 2, 1, 3, 2)])
        made.heatmap.fill_(-9.0)
        made.heatmap[:, TAXONOMY.things.index(CAR), 2, 2] = math.log(4.0)  # probability 0.8; the cell's middle: (2, 2)
        made.offset[:, :, 2, 2] = torch.tensor([0.125, 0.25])
        made.height[:, 0, 2, 2] = -1.0
        made.extent[:, :, 2, 2] = torch.tensor([2.0, 1.0, 0.5]).log()
        return made


def known():
    return Predictor(LeftAndRight(), list(TAXONOMY.things), FALLBACK, Nearest(), Inference())


def semantics(*points):
    (prediction,) = known()([window(torch.tensor(points))])
    return prediction.panoptic.semantics.tolist()


def check_covered(prediction, count):
    """Every point has a class that is not void, and the points of things alone have an id."""
    labels = prediction.panoptic
    assert len(labels.semantics) == len(labels.ids) == len(prediction.claimed) == count
    assert (labels.semantics > 0).all()
    assert torch.equal(labels.ids > 0, TAXONOMY.is_thing(labels.semantics))


def test_points_in_range_read_their_own_class():
    assert semantics([1.0, 1.0, 0.0], [1.0, -1.0, 0.0]) == [CAR, ROAD]


def test_points_out_of_range_read_the_nearest_voxel():
    seen = [[0.0, 7.0, 0.0], [0.0, -7.0, 0.0]]
    assert semantics(*seen, [0.0, 50.0, 0.0], [0.0, -8.5, 0.0], [90.0, 6.0, 0.0]) == [CAR, ROAD, CAR, ROAD, CAR]


def test_points_above_and_below_the_grid_are_in_range():
    assert semantics([0.0, 7.0, 30.0], [0.0, -7.0, -30.0]) == [CAR, ROAD]


@pytest.mark.parametrize("strange", [math.nan, math.inf, -math.inf])
def test_non_finite_points_read_the_voxel_nearest_to_the_middle(strange):
    assert semantics([0.0, -7.0, 0.0], [0.0, 1.0, 0.0], [strange, strange, strange])[2] == CAR


def test_points_out_of_range_do_not_read_voxels_of_another_window():
    left, right = torch.tensor([[0.0, 7.0, 0.0], [0.0, -90.0, 0.0]]), torch.tensor([[0.0, 90.0, 0.0], [0.0, -7.0, 0.0]])
    first, second = known()([window(left, cloud(3)), window(right)])
    assert first.panoptic.semantics[0] == CAR
    assert second.panoptic.semantics.tolist() == [ROAD, ROAD]


def test_points_out_of_range_do_not_read_voxels_of_past_sweeps():
    here, past = torch.tensor([[0.0, 90.0, 0.0], [0.0, -7.0, 0.0]]), torch.tensor([[0.0, 7.0, 0.0]])
    (prediction,) = known()([window(here, past)])
    assert prediction.panoptic.semantics.tolist() == [ROAD, ROAD]


@pytest.mark.parametrize("points", [torch.zeros(0, 3), torch.full((3, 3), 99.0), torch.full((2, 3), math.nan)])
@pytest.mark.parametrize("make", [known, lambda: tiny_predictor()])
def test_a_scan_that_is_empty_or_wholly_out_of_range(points, make):
    predictor = make()
    predictor.network.eval()
    for samples in ([window(points)], [window(points, cloud(9))], [window(cloud(20)), window(points)]):
        prediction = predictor(samples)[-1]
        check_covered(prediction, len(points))
        assert prediction.panoptic.semantics.tolist() == [FALLBACK] * len(points)


def test_detections_are_in_the_sensor_frame():
    _, prediction = known()([window(cloud(9)), window(torch.tensor([[2.5, 4.0, -1.0], [3.0, 2.5, -0.8]]))])
    found = prediction.detections
    assert found.classes.tolist() == [CAR]
    assert torch.allclose(found.centres, torch.tensor([[2.5, 3.0, -1.0]]))
    assert torch.allclose(found.extents, torch.tensor([[2.0, 1.0, 0.5]]))
    assert torch.allclose(prediction.roi, found.extents * 1.3 + 0.3)
    assert prediction.claimed.tolist() == [0, 0]
    assert prediction.panoptic.ids.tolist() == [1, 1]


def test_a_car_that_no_centre_claims_is_its_own_instance():
    (prediction,) = known()([window(torch.tensor([[2.5, 3.0, -1.0], [-7.0, 7.0, 0.0], [2.5, -3.0, -1.0]]))])
    assert prediction.claimed.tolist() == [0, -1, -1]
    assert prediction.panoptic.ids.tolist() == [1, 2, 0]


@pytest.mark.parametrize("seed", range(3))
def test_any_network_labels_every_point(seed):
    predictor = tiny_predictor(seed)
    predictor.network.eval()
    strange = torch.tensor([[99.0, 0.0, 0.0], [0.0, 0.0, 99.0], [math.nan, 0.0, 0.0], [0.0, -math.inf, 0.0]])
    with torch.no_grad():
        predictor.network.semantic_head.voxel.bias[[CAR - 1, PERSON - 1, ROAD - 1]] += 0.5
    samples = [window(torch.cat([street().points[:, :3], strange]), cloud(50)), window(cloud(70, seed), cloud(30))]
    for sample, prediction in zip(samples, predictor(samples), strict=True):
        check_covered(prediction, sample.num_current)
