"""Intervals by a paired hierarchical bootstrap: seeds are drawn, then held-out sequences.

A draw takes as many seeds as there are, with replacement, and as many sequences. Every seed was measured on the same
sequences, so they are crossed, and a draw's sequences are the same for all of its seeds: were they drawn anew for
each, the chance of having had these sequences would average out and the interval be too narrow (the pigeonhole
bootstrap: Owen, 2007). Two strategies are compared under the same draws. Figures are formed anew of each draw's sums,
not averaged over sequences. With few seeds or sequences such intervals are too narrow: with three by a fifth, with
five by a tenth.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float64

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Interval:
    """A figure, and what 95 % of all draws lie between; none where nothing can be drawn."""

    value: float
    low: float | None = None
    high: float | None = None
    above: float | None = None  # share of the draws above 0, half of those at 0 included; of differences


@dataclass(frozen=True)
class Resampling:
    """How often each seed and each sequence is in each draw; the first draw is what was measured."""

    sequences: int
    draws: int = 10_000
    seed: int = 1

    def of_sequences(self) -> Float64[np.ndarray, "draws sequences"]:
        """The same for all strategies and seeds."""
        return _counts(self.sequences, self.draws, (self.seed, 0))

    def of_seeds(self, seeds: int) -> Float64[np.ndarray, "draws seeds"]:
        """The same for all strategies with so many seeds."""
        return _counts(seeds, self.draws, (self.seed, 1, seeds))

    def over_seeds(self, figures: Float64[np.ndarray, "draws seeds"]) -> Float64[np.ndarray, "draws"]:
        """Mean figures over each draw's seeds."""
        seeds = figures.shape[1]
        return (figures * self.of_seeds(seeds)).sum(1) / seeds

    def interval(self, figures: Float64[np.ndarray, "draws seeds"]) -> Interval:
        """A figure's mean over seeds and its interval; figures of draws that are no number are left out."""
        means = self.over_seeds(figures)
        value, drawn = float(means[0]), means[1:][np.isfinite(means[1:])]
        if self.sequences * figures.shape[1] == 1 or not len(drawn) or not np.isfinite(value):
            return Interval(value)
        tail = (1 - CONFIDENCE) / 2
        low, high = np.quantile(drawn, [tail, 1 - tail])
        return Interval(value, float(low), float(high), float(((drawn > 0) + 0.5 * (drawn == 0)).mean()))


@lru_cache(maxsize=8)
def _counts(items: int, draws: int, seed: tuple[int, ...]) -> Float64[np.ndarray, "draws items"]:
    drawn = np.random.default_rng(seed).multinomial(items, np.full(items, 1 / items), draws)
    return np.concatenate([np.ones((1, items)), drawn])
