import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from most.datasets.augment import Augment
from most.errors import ConfigError


@given(
    seed=st.integers(0, 10**6),
    flip_x=st.booleans(),
    flip_y=st.booleans(),
    rotation=st.floats(0, 180),
    low=st.floats(0.5, 1.0),
    high=st.floats(1.0, 2.0),
)
def test_transform_is_a_similarity_within_its_bounds(
    seed: int, flip_x: bool, flip_y: bool, rotation: float, low: float, high: float
) -> None:
    augment = Augment(flip_x, flip_y, rotation, [low, high])
    linear = augment.transform(np.random.default_rng(seed)).linear
    scale = float(linear[2, 2])
    assert low <= scale <= high
    unit = linear / scale
    torch.testing.assert_close(unit @ unit.T, torch.eye(3, dtype=torch.float64))
    assert unit[2].tolist() == [0, 0, 1]
    if not flip_x and not flip_y:
        assert abs(math.degrees(math.atan2(unit[1, 0], unit[0, 0]))) <= rotation + 1e-6


def test_off_by_default() -> None:
    change = Augment().transform(np.random.default_rng(0))
    points = torch.randn(5, 3)
    assert torch.equal(change.apply(points), points)


def test_flips_mirror_the_named_axis_half_of_the_time() -> None:
    rng = np.random.default_rng(0)
    diagonals = [tuple(Augment(flip_x=True).transform(rng).linear.diagonal().tolist()) for _ in range(200)]
    assert set(diagonals) == {(1, 1, 1), (-1, 1, 1)}
    assert 70 < diagonals.count((-1, 1, 1)) < 130


def test_translation_has_the_named_deviation() -> None:
    rng = np.random.default_rng(0)
    moves = torch.stack([Augment(translation=[0.5, 0.2, 0.0]).transform(rng).translation for _ in range(500)])
    torch.testing.assert_close(moves.std(0), torch.tensor([0.5, 0.2, 0.0]).double(), rtol=0.1, atol=0)


def test_intensities_rise_and_fall_within_their_share() -> None:
    rng = np.random.default_rng(0)
    factors = [Augment(intensity=0.1).brightness(rng) for _ in range(200)]
    assert 0.9 <= min(factors) < 0.92
    assert 1.08 < max(factors) <= 1.1
    assert Augment().brightness(rng) == 1.0


def test_same_generator_same_transform() -> None:
    augment = Augment(True, True, 45.0, [0.9, 1.1], [0.5, 0.5, 0.5])
    one, other = (augment.transform(np.random.default_rng([1, 2, 3])) for _ in range(2))
    assert torch.equal(one.linear, other.linear)
    assert torch.equal(one.translation, other.translation)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"rotation": -1.0}, r"augment\.rotation: expected degrees in 0\.\.180, found -1\.0"),
        ({"rotation": 181.0}, r"augment\.rotation"),
        ({"scale": [1.0]}, r"augment\.scale: expected \[lowest, highest\], both above 0, found \[1\.0\]"),
        ({"scale": [1.1, 0.9]}, r"augment\.scale"),
        ({"scale": [0.0, 1.0]}, r"augment\.scale"),
        (
            {"translation": [0.0, -0.1, 0.0]},
            r"augment\.translation: expected \[x, y, z\] in metres >= 0, found \[0\.0, -0\.1, 0\.0\]",
        ),
        ({"translation": [0.0, 0.0, math.nan]}, r"augment\.translation"),
        ({"translation": [0.1, 0.1]}, r"augment\.translation"),
        ({"intensity": -0.1}, r"augment\.intensity: expected a share in 0\.\.1, found -0\.1"),
        ({"half_swap": 1.5}, r"augment\.half_swap: expected a share in 0\.\.1, found 1\.5"),
    ],
)
def test_faulty_settings_are_refused(settings: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Augment(**settings)
