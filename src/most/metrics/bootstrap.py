"""Intervals by a paired hierarchical bootstrap: seeds are drawn, then held-out sequences.

A draw takes as many seeds as there are, with replacement, and as many sequences. Every seed was measured on the same
sequences, so they are crossed, and a draw's sequences are the same for all of its seeds: were they drawn anew for
each, the chance of having had these sequences would average out and the interval be too narrow (the pigeonhole
bootstrap: Owen, 2007). Two strategies are compared under the same draws. Figures are formed anew of each draw's sums,
not averaged over sequences.

Draws of few are too close together: of three seeds their spread is that of two degrees of freedom, of which a 95 %
interval of plain draws holds less than 75 %. So they are moved away from what was measured, all by one factor, until
their variance is unbiased and their width that of Student's t, whose degrees of freedom follow from how much of the
variance comes of seeds and how much of sequences (Satterthwaite, 1946). An interval of one seed tells of sequences
alone, and one of one sequence of seeds alone.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float64
from scipy.stats import norm, t

CONFIDENCE = 0.95
TAIL = (1 - CONFIDENCE) / 2


@dataclass(frozen=True)
class Interval:
    """A figure, and what 95 % of all draws lie between; none where nothing can be drawn."""

    value: float
    low: float | None = None
    high: float | None = None
    above: float | None = None  # share of the draws so spread that lie above 0, half of those at 0 included


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

    def interval(
        self, figures: Float64[np.ndarray, "draws seeds"], within: tuple[float, float] = (-np.inf, np.inf)
    ) -> Interval:
        """A figure's mean over seeds and its interval; figures of draws that are no number are left out.

        ``within`` is what the figure cannot leave, unless a draw does.
        """
        means = self.over_seeds(figures)
        value, drawn = float(means[0]), means[1:][np.isfinite(means[1:])]
        if self.sequences * figures.shape[1] == 1 or not len(drawn) or not np.isfinite(value):
            return Interval(value)
        lowest, highest = min(within[0], drawn.min()), max(within[1], drawn.max())
        drawn = np.clip(value + self._spread(figures, drawn) * (drawn - value), lowest, highest)
        low, high = np.quantile(drawn, [TAIL, 1 - TAIL])
        return Interval(value, float(low), float(high), float(((drawn > 0) + 0.5 * (drawn == 0)).mean()))

    def _spread(self, figures: Float64[np.ndarray, "draws seeds"], drawn: Float64[np.ndarray, "found"]) -> float:
        """How many times further from what was measured draws have to lie, for so few seeds and sequences."""
        seeds, of_sequences = figures.shape[1], figures[1:].mean(1)
        plain = ((seeds, figures[0].var() / seeds), (self.sequences, of_sequences[np.isfinite(of_sequences)].var()))
        parts = [(n - 1, variance * n / (n - 1)) for n, variance in plain if n > 1]  # a mean's, unbiased
        total = sum(variance for _, variance in parts)
        if not total or not drawn.var():
            return 1.0
        freedom = total**2 / sum(variance**2 / free for free, variance in parts)
        return float(t.ppf(TAIL, freedom) / norm.ppf(TAIL) * np.sqrt(total / drawn.var()))


@lru_cache(maxsize=8)
def _counts(items: int, draws: int, seed: tuple[int, ...]) -> Float64[np.ndarray, "draws items"]:
    drawn = np.random.default_rng(seed).multinomial(items, np.full(items, 1 / items), draws)
    return np.concatenate([np.ones((1, items)), drawn])
