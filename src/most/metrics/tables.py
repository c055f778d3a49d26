"""Sparse counts as tables of integers: a row is a key of some columns, and the amounts counted for it.

Rows with the same key mean their sum, so tables of parts are merged by putting them under each other, in any order.
"""

import numpy as np
from jaxtyping import Int64

from most.metrics.renumber import Integers


def sum_rows(rows: Int64[np.ndarray, "rows columns"], keys: int) -> Int64[np.ndarray, "sums columns"]:
    """Add up the amounts of rows that agree in their first ``keys`` columns; ascending by them."""
    if not len(rows):
        return rows
    rows = rows[np.lexsort(rows[:, :keys].T[::-1])]
    first = np.flatnonzero(np.r_[True, (rows[1:, :keys] != rows[:-1, :keys]).any(1)])
    return np.column_stack([rows[first, :keys], np.add.reduceat(rows[:, keys:], first)])


def find_rows(
    keys: Int64[np.ndarray, "rows columns"], wanted: Int64[np.ndarray, "wanted columns"]
) -> Int64[np.ndarray, "wanted"]:
    """Index of the row that has each wanted key, -1 where none has; keys are distinct."""
    _, number = np.unique(np.concatenate([keys, wanted]), axis=0, return_inverse=True)
    number = number.reshape(-1)  # some releases of numpy keep an axis
    row_of_number = np.full(len(number), -1)
    row_of_number[number[: len(keys)]] = np.arange(len(keys))
    return row_of_number[number[len(keys) :]]


def table(*columns: Integers | int) -> Int64[np.ndarray, "rows columns"]:
    """Columns side by side; a number fills its column. At least one column is an array."""
    count = next(len(column) for column in columns if not isinstance(column, int))
    rows = np.empty((count, len(columns)), dtype=np.int64)
    for index, column in enumerate(columns):
        rows[:, index] = column
    return rows
