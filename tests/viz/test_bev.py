import pytest
import torch
from matplotlib.collections import PatchCollection
from matplotlib.image import imread

from most.geometry.boxes import along
from most.structures import Detections, Instances, Panoptic
from most.viz.bev import draw_bev, save

NAMES, COLOURS, THINGS = ["void", "car", "road"], [[0, 0, 0], [100, 150, 245], [255, 0, 255]], [1]
POINTS = torch.tensor([[10.0, 0, 0, 0.5], [11, 0, 0, 0.5], [-5, 3, -1, 0.1], [0, 8, -1, 0.1]])


@pytest.fixture
def truth():
    return Panoptic(torch.tensor([1, 1, 2, 0]), torch.tensor([65537, 65537, 0, 0]))


@pytest.fixture
def prediction():
    return Panoptic(torch.tensor([1, 1, 1, 2]), torch.tensor([1, 1, 0, 0]))


@pytest.fixture
def detections():
    centres, sizes = torch.tensor([[10.5, 0, 0], [-20, 5, 0]]), torch.full((2, 3), 2.0)
    velocities = torch.tensor([[10.0, 1.0], [0.1, 0.0]])
    return Detections(torch.tensor([1, 1]), torch.tensor([0.9, 0.4]), centres, sizes, velocities)


@pytest.fixture
def instances():
    return Instances(
        keys=torch.tensor([65537]),
        classes=torch.tensor([1]),
        counts=torch.tensor([2]),
        centres=torch.tensor([[10.5, 0, 0]]),
        extents=torch.tensor([[0.5, 0.05, 0.05]]),
        velocities=torch.tensor([[30.0, 0.0]]),
        velocity_known=torch.tensor([False]),
    )


def written(figure):
    """All text of a figure."""
    texts = [text.get_text() for part in (figure, *figure.axes) for text in part.texts]
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]
    return texts + [text.get_text() for legend in legends for text in legend.get_texts()]


def arrows(axes):
    return sum(getattr(collection, "N", 0) for collection in axes.collections)


def test_truth_prediction_and_errors(truth, prediction, detections, instances):
    arguments = (POINTS, truth, prediction, detections, instances, NAMES, COLOURS, THINGS)
    figure = draw_bev(*arguments, title="07 000004", figures={"PQ": 0.75})
    assert len(figure.axes) == 3
    # One of three scored points is wrong.
    expected = {"07 000004", "PQ 75.0%", "truth", "instances: 1", "prediction", "detections: 2", "errors"}
    assert expected | {"33.3% of the points", "car", "road", "wrong class"} <= set(written(figure))
    assert "void" not in written(figure)
    assert [arrows(axes) for axes in figure.axes] == [0, 1, 0]  # unknown and slow velocities have none


def test_without_truth_there_is_the_prediction_alone(prediction, detections):
    figure = draw_bev(POINTS, None, prediction, detections, None, NAMES, COLOURS, THINGS)
    assert len(figure.axes) == 1
    assert "prediction" in written(figure)


def test_a_scan_without_points_things_or_detections(prediction, detections):
    nothing = Panoptic(prediction.semantics[:0], prediction.ids[:0])
    none = detections.select(torch.zeros(2, dtype=torch.bool))
    assert len(draw_bev(POINTS[:0], nothing, nothing, none, None, NAMES, COLOURS, THINGS).axes) == 3


def test_the_inputs_are_left_as_they_are(truth, prediction, detections, instances):
    inputs = (truth, prediction, detections, instances)
    before = [tensor.clone() for part in inputs for tensor in vars(part).values() if tensor is not None]
    draw_bev(POINTS, truth, prediction, detections, instances, NAMES, COLOURS, THINGS)
    after = [tensor for part in inputs for tensor in vars(part).values() if tensor is not None]
    assert all(torch.equal(one, other) for one, other in zip(before, after, strict=True))


def test_it_is_saved_as_a_png_that_can_be_read(tmp_path, prediction, detections):
    figure = draw_bev(POINTS, None, prediction, detections, None, NAMES, COLOURS, THINGS)
    path = tmp_path / "pictures" / "bev.png"
    save(figure, path)
    assert imread(path).shape[1] > 1000
    assert [file.name for file in path.parent.iterdir()] == ["bev.png"]


def test_a_turned_box_is_drawn_turned(prediction, detections):
    """One 4 m long and 2 m wide that looks to the left of ahead: its front left corner is (x, y) = (2, 0) turned."""
    turned = detections.select(torch.tensor([0]))
    turned.extents, turned.yaws = torch.tensor([[2.0, 1.0, 1.0]]), torch.tensor([0.6])
    figure = draw_bev(POINTS, None, prediction, turned, None, NAMES, COLOURS, THINGS)
    (boxes,) = (one for one in figure.axes[0].collections if isinstance(one, PatchCollection))
    (path,) = boxes.get_paths()
    corners = torch.tensor([[2.0, 1, 0], [2, -1, 0], [-2, 1, 0], [-2, -1, 0]])
    expected = along(corners, torch.full((4,), -0.6))[:, :2] + turned.centres[0, :2]
    drawn = torch.tensor(path.vertices[:4, ::-1].copy()).float()  # y, x
    assert torch.cdist(drawn, expected).amin(1).max() < 1e-4
    assert torch.cdist(expected, drawn).amin(1).max() < 1e-4
