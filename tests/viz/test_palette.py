import numpy as np
from matplotlib.colors import to_rgb

from most.viz.palette import GROUND, INSTANCES, UNCLAIMED, bright, muted, numbered, paint

COLOURS = [[0, 0, 0], [100, 150, 245], [0, 0, 255], [255, 0, 255]]


def test_neighbours_in_azimuth_differ():
    angles = np.radians([10, 20, 30, 40])
    points = np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)
    places = numbered(np.array([7, 3, 9, 0]), points, {})
    assert sorted(places) == [3, 7, 9]
    assert abs(places[7] - places[3]) == abs(places[3] - places[9]) == 1


def test_a_taken_colour_is_kept():
    points = np.array([[1.0, 0, 0], [0, 1.0, 0]])
    assert numbered(np.array([7, 3]), points, {7: 5})[7] == 5


def test_stuff_has_its_class_colour_and_things_their_instances():
    painted = paint(np.array([3, 1, 1, 1]), np.array([0, 8, 9, 0]), {8: 0, 9: 1}, COLOURS, [1, 2])
    expected = [muted(COLOURS)[3], to_rgb(INSTANCES[0]), to_rgb(INSTANCES[1]), to_rgb(UNCLAIMED)]
    assert np.allclose(painted, expected)


def luminance(colour):
    return float(np.dot(colour, (0.2126, 0.7152, 0.0722)))


def test_instances_outshine_all_stuff_and_stuff_the_ground():
    stuff = [luminance(colour) for colour in muted([[255, 255, 0], [0, 0, 0], [255, 0, 255], [0, 175, 0]])]
    assert min(luminance(to_rgb(colour)) for colour in INSTANCES) > 0.45
    assert min(stuff) > luminance(to_rgb(GROUND))
    assert all(luminance(bright(colour)) > 0.3 for colour in COLOURS)
