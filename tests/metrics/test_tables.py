"""Tables of counts: sums by key, look-ups, and running totals that do not grow with what they have seen."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from most.metrics import table_metric
from most.metrics.exact_sums import exact_parts, joined
from most.metrics.table_metric import TableMetric
from most.metrics.tables import find_rows, sum_rows, table

ROWS = st.lists(st.tuples(*[st.integers(-2, 2)] * 2, st.integers(0, 2**40)), max_size=12)


def rows_of(rows: list[tuple[int, ...]]) -> np.ndarray:
    return np.array(rows, dtype=np.int64).reshape(-1, 3)


def test_rows_of_one_key_add_up() -> None:
    rows = rows_of([(2, 1, 5), (1, 9, 1), (2, 1, 7), (1, 3, 4)])
    assert sum_rows(rows, 2).tolist() == [[1, 3, 4], [1, 9, 1], [2, 1, 12]]


@given(ROWS, st.randoms(use_true_random=False))
def test_sums_agree_with_a_dictionary_in_any_order(rows: list[tuple[int, ...]], random: object) -> None:
    sums: dict[tuple[int, int], int] = {}
    for one, two, amount in rows:
        sums[one, two] = sums.get((one, two), 0) + amount
    random.shuffle(rows)  # type: ignore[attr-defined]
    assert sum_rows(rows_of(rows), 2).tolist() == [[*key, sums[key]] for key in sorted(sums)]


def test_rows_are_found_by_their_keys() -> None:
    keys = np.array([[1, 3], [1, 9], [2, 1]])
    assert find_rows(keys, np.array([[2, 1], [9, 1], [1, 3], [2, 1]])).tolist() == [2, -1, 0, 2]
    assert find_rows(keys[:0], keys).tolist() == [-1, -1, -1]
    assert find_rows(keys, keys[:0]).tolist() == []
    assert find_rows(keys[:0], keys[:0]).tolist() == []


def test_a_number_fills_its_column() -> None:
    assert table(7, np.array([1, 2]), 0).tolist() == [[7, 1, 0], [7, 2, 0]]
    assert table(7, np.zeros(0, dtype=np.int64)).shape == (0, 2)


class Counts(TableMetric):
    def update(self, key: int) -> None:
        self.add_rows("counts", np.array([[key, 2], [5, 1]]))

    def compute(self) -> list[list[int]]:
        return self.rows("counts").tolist()


def test_running_tables_hold_as_many_rows_as_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_metric, "LOOSE_PARTS", 10)
    metric = Counts()
    metric.add_table("counts", keys=1, amounts=1)
    for _ in range(100):
        metric.update(1)
        assert sum(len(part) for part in metric.counts) <= 10 * 2
    assert metric.compute() == [[1, 200], [5, 100]]


@given(st.lists(st.floats(0.5, 1), min_size=1, max_size=40), st.randoms(use_true_random=False))
def test_sums_of_parts_are_the_same_in_any_order(amounts: list[float], random: object) -> None:
    def total() -> torch.Tensor:
        return sum(exact_parts(torch.tensor([amount], dtype=torch.float64)) for amount in amounts)

    before = total()
    random.shuffle(amounts)  # type: ignore[attr-defined]
    assert torch.equal(before, total())
    assert joined(before).item() == pytest.approx(sum(amounts), abs=1e-13)
