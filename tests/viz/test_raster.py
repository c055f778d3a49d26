import numpy as np

from most.viz.raster import rasterise

RED, BLUE, BLACK = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


def draw(points, colours, prominent=None):
    """10 x 10 pixels of 1 m."""
    chosen = np.zeros(len(points), bool) if prominent is None else np.array(prominent)
    image = rasterise(np.array(points, float).reshape(-1, 3), np.array(colours).reshape(-1, 3), chosen, 5.0, BLACK, 10)
    return {(row, column): tuple(image[row, column] / 255) for row, column in np.argwhere(image.any(2)).tolist()}


def test_ahead_is_up_and_left_is_left():
    assert draw([[4.5, 0.5, 0], [0.5, 4.5, 0]], [RED, BLUE]) == {(0, 4): RED, (4, 0): BLUE}


def test_points_beyond_the_picture_are_left_out():
    assert draw([[5.5, 0, 0], [0, -5.5, 0]], [RED, RED]) == {}
    assert draw([], []) == {}


def test_the_higher_point_is_seen():
    assert draw([[0.5, 0.5, 2], [0.5, 0.5, 1]], [RED, BLUE]) == {(4, 4): RED}


def test_prominent_points_are_larger_and_on_top():
    seen = draw([[0.5, 0.5, 2], [0.5, 0.5, 1]], [RED, BLUE], [False, True])
    assert seen == {(4, 4): BLUE, (4, 5): BLUE, (5, 4): BLUE, (5, 5): BLUE}
    assert draw([[-4.5, -4.5, 0]], [RED], [True]) == {(9, 9): RED}
