"""Renumbering agrees with numpy.unique, whatever the range of the values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from most.metrics.renumber import TABLE, renumber

INT64 = st.integers(-(2**63), 2**63 - 1)


@pytest.mark.parametrize(
    "values",
    [[], [7], [3, 3, -2], [0, TABLE - 1], [0, TABLE], [2**32 - 1, 0, 2**31], [-(2**63), 2**63 - 1, 0]],
    ids=str,
)
def test_hand_made_ranges(values: list[int]) -> None:
    given_values = np.array(values, dtype=np.int64)
    distinct, index = renumber(given_values)
    assert distinct.tolist() == sorted(set(values))
    assert np.array_equal(distinct[index], given_values)


@given(st.lists(INT64 | st.integers(0, 2**32 - 1) | st.integers(0, 9)))
def test_agrees_with_a_sort(values: list[int]) -> None:
    expected_distinct, expected_index = np.unique(np.array(values, dtype=np.int64), return_inverse=True)
    distinct, index = renumber(np.array(values, dtype=np.int64))
    assert np.array_equal(distinct, expected_distinct)
    assert np.array_equal(index, expected_index)


def test_many_labels_with_many_upper_and_lower_bits_fall_back_to_a_sort() -> None:
    values = np.random.default_rng(0).integers(0, 2**32, 3000)
    distinct, index = renumber(values)
    assert np.array_equal(distinct, np.unique(values))
    assert np.array_equal(distinct[index], values)
