"""The bootstrap: by hand where there is little to draw, against scipy where there is much, and covering on a toy."""

import numpy as np
import pytest
from scipy.stats import bootstrap, t

from most.metrics.bootstrap import Interval, Resampling


def additive(resampling: Resampling, values: np.ndarray) -> np.ndarray:
    """A figure that is the mean of a number for each sequence and seed, in each draw."""
    return resampling.of_sequences() @ values / values.shape[0]


def test_two_sequences_are_drawn_in_four_ways_by_hand() -> None:
    """Both of one, both of the other, or one of each (twice as often): 0, 1, 0.5."""
    resampling = Resampling(sequences=2, draws=4000)
    drawn = additive(resampling, np.array([[0.0], [1.0]]))[:, 0]
    assert drawn[0] == 0.5  # as measured
    shares = [(drawn[1:] == value).mean() for value in (0, 0.5, 1)]
    assert shares == pytest.approx([0.25, 0.5, 0.25], abs=0.03)
    interval = resampling.interval(drawn[:, None], within=(0, 1))
    assert (interval.value, interval.low, interval.high) == (0.5, 0.0, 1.0)  # of two nothing is known
    assert interval.above == pytest.approx(0.875, abs=0.02)  # draws at 0 count half


def test_of_one_run_on_one_sequence_nothing_can_be_said() -> None:
    assert Resampling(sequences=1).interval(np.full((10_001, 1), 0.7)) == Interval(0.7)


def test_seeds_are_drawn_too() -> None:
    """On one sequence two seeds at 0 and 1 are as two sequences."""
    interval = Resampling(sequences=1, draws=4000).interval(np.tile([0.0, 1.0], (4001, 1)), within=(0, 1))
    assert (interval.value, interval.low, interval.high) == (0.5, 0.0, 1.0)


def test_of_many_sequences_it_is_scipys_percentile_bootstrap() -> None:
    values = np.random.default_rng(0).normal(0.5, 0.1, 400)
    ours = Resampling(sequences=400).interval(additive(Resampling(sequences=400), values[:, None]))
    scipys = bootstrap((values,), np.mean, n_resamples=10_000, method="percentile", rng=1).confidence_interval
    assert (ours.low, ours.high) == pytest.approx((scipys.low, scipys.high), abs=0.0003)


@pytest.mark.parametrize(("seeds", "sequences"), [(1, 12), (5, 1)])
def test_of_few_it_is_as_wide_as_students(seeds: int, sequences: int) -> None:
    values = np.random.default_rng(0).normal(0.5, 0.1, (sequences, seeds))
    ours = Resampling(sequences).interval(additive(Resampling(sequences), values))
    n = values.size
    error = values.std(ddof=1) / np.sqrt(n)
    assert ours.high - ours.low == pytest.approx(2 * error * t.ppf(0.975, n - 1), rel=0.08)


def test_freedom_is_that_of_the_part_which_varies() -> None:
    """Seeds that agree leave the interval to the sequences, and the other way round."""
    effects = np.random.default_rng(0).normal(0, 0.1, (12, 1))
    one, three = (Resampling(12).interval(additive(Resampling(12), np.tile(effects, seeds))) for seeds in (1, 3))
    assert (one.low, one.high) == pytest.approx((three.low, three.high), rel=1e-6)


def test_an_interval_stays_where_a_figure_can_be() -> None:
    drawn = additive(Resampling(3), np.array([[0.9], [1.0], [1.0]]))
    assert Resampling(3).interval(drawn).high > 1
    assert Resampling(3).interval(drawn, within=(0, 1)).high == 1


def test_the_same_seed_gives_the_same_interval_and_another_one_another() -> None:
    values = np.random.default_rng(0).normal(0.5, 0.1, (6, 3))
    one, same, other = (
        Resampling(6, draws=500, seed=seed).interval(additive(Resampling(6, 500, seed), values)) for seed in (1, 1, 2)
    )
    assert one == same
    assert one.value == other.value
    assert one.low != other.low


def test_pairs_are_drawn_together() -> None:
    """Sequences differ by far more than the strategies, whose difference is the same everywhere."""
    resampling = Resampling(sequences=8)
    worse = np.random.default_rng(0).normal(0.5, 0.2, (8, 3))
    difference = resampling.interval(additive(resampling, worse + 0.01) - additive(resampling, worse))
    assert difference.low == pytest.approx(0.01)
    assert difference.high == pytest.approx(0.01)
    assert difference.above == 1


def test_draws_without_a_figure_are_left_out() -> None:
    figures = np.array([[0.5], [np.nan], [0.4], [0.6]])
    assert Resampling(sequences=3, draws=3).interval(figures) == Resampling(3, 2).interval(figures[[0, 2, 3]])


@pytest.mark.parametrize(
    ("seeds", "sequences", "of_seeds", "of_sequences"),
    [(10, 12, 1.0, 1.0), (3, 12, 1.0, 0.0), (5, 14, 1.0, 1.0), (1, 4, 0.0, 1.0), (3, 1, 1.0, 0.0), (5, 14, 0.3, 1.0)],
)
def test_intervals_cover_what_is_to_be_found_about_as_often_as_they_say(
    seeds: int, sequences: int, of_seeds: float, of_sequences: float
) -> None:
    """Effects of seeds, of sequences (the same for all seeds) and, weaker, of both; the mean of all is sought."""
    random, covered, experiments = np.random.default_rng(1), 0, 200
    for number in range(experiments):
        effects = random.normal(0, of_sequences * sequences**0.5, (sequences, 1))
        effects = effects + random.normal(0, of_seeds * seeds**0.5, (1, seeds))
        effects += random.normal(0, 0.3, (sequences, seeds))
        resampling = Resampling(sequences=sequences, draws=400, seed=number)
        interval = resampling.interval(additive(resampling, effects))
        covered += interval.low <= 0 <= interval.high
    assert 0.9 <= covered / experiments <= 0.99
