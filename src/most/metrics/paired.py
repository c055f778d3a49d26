"""Is one way better than another? Both are measured on the same sequences, so what differs within each is averaged."""

from collections.abc import Sequence

import numpy as np

from most.errors import DataError
from most.metrics.bootstrap import Interval, Resampling


def paired_difference(better: Sequence[float], worse: Sequence[float]) -> Interval:
    """Return the mean of ``better - worse``, a number for each sequence in both, and its interval over sequences.

    Raises DataError for less than two sequences, which say nothing of others, and for what is no number.
    """
    differences = np.asarray(better, np.float64) - np.asarray(worse, np.float64)
    if len(differences) < 2 or not np.isfinite(differences).all():
        raise DataError(
            f"paired interval: expected finite figures of two sequences or more, found differences {differences}"
        )
    resampling = Resampling(len(differences))
    return resampling.interval((resampling.of_sequences() @ differences / len(differences))[:, None])
