"""Rays against answers worked out by hand."""

import numpy as np
import pytest

from most.simulation.mesh import Mesh, box, ellipsoid, loft, merge, rotation, tube
from most.simulation.scene import Scene
from most.simulation.surfaces import Surface

DOWN = np.array([[1.0, 0, -1], [0.0, 3, -4], [0, 0, 1]]) / np.array([[np.sqrt(2)], [5], [1]])


def _floor() -> Mesh:
    return box((-50, -50, -1), (50, 50, 0), Surface.ASPHALT)


def test_flat_ground_is_met_at_height_over_sine():
    hits = Scene([_floor()], [0], [1.0]).cast(np.array([0, 0, 2.0]), DOWN)
    assert hits.distance[:2] == pytest.approx([2 * np.sqrt(2), 2 * 5 / 4], rel=1e-6)
    assert hits.cosine[:2] == pytest.approx([1 / np.sqrt(2), 0.8], rel=1e-5)
    assert np.isinf(hits.distance[2])
    assert hits.label.tolist() == [40, 40, 0]


def test_the_nearer_hides_the_further_within_a_scene_and_between_two():
    ahead = np.array([[1.0, 0, 0]])
    near, far = (box((x, -1, -1), (x + 1, 1, 1), Surface.PAINT) for x in (5, 9))
    both = Scene([far, near], [7 << 16 | 10, 8 << 16 | 18], [1.0, 1.0]).cast(np.zeros(3), ahead)
    assert (both.distance[0], both.label[0]) == (pytest.approx(5), 8 << 16 | 18)
    apart = [Scene([mesh], [label], [1.0]).cast(np.zeros(3), ahead) for mesh, label in ((far, 7), (near, 8))]
    assert apart[0].nearer(apart[1]).label.tolist() == [8]
    assert apart[1].nearer(apart[0]).label.tolist() == [8]


def test_gain_darkens_paint_and_not_tyres():
    ahead, gains = np.array([[1.0, 0, 0]]), (1.0, 0.5)
    for surface, expected in ((Surface.PAINT, 0.5), (Surface.TYRE, 1.0)):
        block = box((5, -1, -1), (6, 1, 1), surface)
        bright, dark = (Scene([block], [1 << 16 | 10], [gain]).cast(np.zeros(3), ahead) for gain in gains)
        assert dark.reflectivity / bright.reflectivity == pytest.approx(expected)


def _volume(mesh: Mesh) -> float:
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def test_solids_are_closed_and_as_large_as_told():
    assert np.abs(_volume(box((0, 0, 0), (1, 2, 3), Surface.WALL))) == pytest.approx(6)
    many_sided = tube((1, 1, 1), (1, 3, 1), 0.5, Surface.POLE, sides=200)
    assert np.abs(_volume(many_sided)) == pytest.approx(np.pi * 0.25 * 2, rel=1e-3)
    round_ = ellipsoid((1, 2, 3), (1, 2, 3), Surface.CLOTH, subdivisions=4)
    assert np.abs(_volume(round_)) == pytest.approx(4 / 3 * np.pi * 6, rel=1e-2)


def test_moving_turns_first_and_shifts_then():
    ring = np.array([[[1.0, 0, 0], [1, 1, 0], [1, 1, 1]], [[2, 0, 0], [2, 1, 0], [2, 1, 1]]])
    moved = loft(ring, Surface.WALL).moved((10, 0, 0), np.pi / 2)
    assert moved.vertices[0] == pytest.approx([10, 1, 0])
    assert rotation(np.pi / 2) @ [1, 0, 0] == pytest.approx([0, 1, 0])


def test_merged_meshes_keep_their_triangles():
    parts = [box((x, 0, 0), (x + 1, 1, 1), Surface.WALL) for x in (0, 5)]
    whole = merge(parts)
    expected = np.concatenate([part.vertices[part.faces] for part in parts])
    assert np.array_equal(whole.vertices[whole.faces], expected)
