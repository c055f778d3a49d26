"""Dense numbers for sparse integers: what ``numpy.unique`` does with ``return_inverse``, without its sort."""

import numpy as np
from numpy.typing import NDArray

TABLE = 2**20  # entries of the largest look-up table; beyond it a sort is cheaper

Integers = NDArray[np.int64]


def renumber(values: Integers) -> tuple[Integers, Integers]:
    """The distinct values, ascending, and the index of each value among them.

    A small range goes through a table. A large one, such as that of 32-bit labels, is split into its upper and lower
    bits, which seldom take many values each. No two values can collide.
    """
    if not len(values):
        return values, values
    low, high = int(values.min()), int(values.max())
    if high - low < TABLE:
        return _by_table(values, low, high - low + 1)
    upper, upper_index = renumber(values >> 16)
    lower, lower_index = renumber(values & 0xFFFF)
    if len(upper) * len(lower) > TABLE:
        return np.unique(values, return_inverse=True)
    pairs, index = renumber(upper_index * len(lower) + lower_index)
    return (upper[pairs // len(lower)] << 16) + lower[pairs % len(lower)], index


def _by_table(values: Integers, low: int, size: int) -> tuple[Integers, Integers]:
    """Renumber values in ``low .. low + size - 1``."""
    shifted = values - low
    occurs = np.zeros(size, dtype=bool)
    occurs[shifted] = True
    distinct = np.flatnonzero(occurs)
    numbers = np.empty(size, dtype=np.int64)
    numbers[distinct] = np.arange(len(distinct))
    return distinct + low, numbers.take(shifted)
