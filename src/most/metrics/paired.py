"""Is one way better than another? Both are measured on the same sequences, so what differs within each is averaged."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import bootstrap

from most.errors import DataError

CONFIDENCE, DRAWS, SEED = 0.95, 10_000, 1


@dataclass(frozen=True)
class Difference:
    """The mean of paired differences, and the interval that holds that of 95 % of all draws of as many sequences."""

    mean: float
    low: float
    high: float


def paired_difference(better: Sequence[float], worse: Sequence[float]) -> Difference:
    """Return mean and percentile bootstrap interval of ``better - worse``, a number for each sequence in both.

    Raises DataError for less than two sequences, which say nothing of others, and for what is no number.
    """
    differences = np.asarray(better, np.float64) - np.asarray(worse, np.float64)
    if len(differences) < 2 or not np.isfinite(differences).all():
        raise DataError(
            f"paired interval: expected finite figures of two sequences or more, found differences {differences}"
        )
    found = bootstrap(
        (differences,), np.mean, n_resamples=DRAWS, confidence_level=CONFIDENCE, method="percentile", random_state=SEED
    )
    low, high = found.confidence_interval
    return Difference(float(differences.mean()), float(low), float(high))
