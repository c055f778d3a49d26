"""Panoptic figures: the official evaluators' goldens, cases worked out by hand, and properties."""

import math
from pathlib import Path

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from golden_cases import GoldenCase, golden_paths, name_of, read_golden
from most.metrics.panoptic import (
    PanopticStatistics,
    class_figures,
    panoptic_figures,
    panoptic_statistics,
    per_class,
)
from oracles.official_panoptic import OfficialPanoptic

SEMANTICKITTI_NAMES = {"pq": "pq_mean", "sq": "sq_mean", "rq": "rq_mean", "miou": "iou_mean"}
PERSON, ROAD, CAR = 1, 2, 3  # training ids of the hand-made cases; car and person are things
THINGS = [PERSON, CAR]


def statistics(
    truth: list[tuple[int, int, int]], pred: list[tuple[int, int, int]], min_points: int = 1
) -> PanopticStatistics:
    """Statistics of a scan given as (points, class, key) stretches, in the order of the points."""
    columns = []
    for stretches in (pred, truth):
        for column in (1, 2):
            columns.append(torch.cat([torch.full((row[0],), row[column]) for row in stretches]))
    return panoptic_statistics(*columns, num_classes=4, min_points=min_points)


@pytest.mark.parametrize("path", golden_paths("semantickitti_pq", "semantickitti_lstq"), ids=name_of)
def test_semantickitti_goldens(path: Path) -> None:
    golden = read_golden(path)
    expected = golden.expected["pq"]
    total = assert_official_rows(golden, expected)
    figures = panoptic_figures(total, things=range(1, 9))
    for name, official in SEMANTICKITTI_NAMES.items():
        assert figures[name] == pytest.approx(expected["overall"][official], abs=1e-9)
    for name in ("pq_dagger", *(f"{m}_{part}" for m in ("pq", "sq", "rq") for part in ("things", "stuff"))):
        assert figures[name] == pytest.approx(expected["overall"][name], abs=1e-9)


@pytest.mark.parametrize("path", golden_paths("nuscenes_pq", "nuscenes_pat_lstq"), ids=name_of)
def test_nuscenes_goldens(path: Path) -> None:
    golden = read_golden(path)
    expected = golden.expected["segmentation"]
    total = assert_official_rows(golden, expected)
    figures = panoptic_figures(total, things=range(1, 11))
    assert set(expected["overall"]) == {"PQ", "SQ", "RQ", "mIoU", "PQ_dagger"}
    for official, value in expected["overall"].items():
        assert figures[official.lower()] == pytest.approx(value, abs=1e-9)
    for official, value in expected["derived"].items():
        assert figures[official.lower().replace("iou", "miou")] == pytest.approx(value, abs=1e-9)


def assert_official_rows(golden: GoldenCase, expected: dict) -> PanopticStatistics:
    """The classes' figures are the official ones; returns the statistics of all scans."""
    classes = expected["per_class"]
    total = PanopticStatistics.zeros(len(classes))
    for scan in golden.scans:
        total += panoptic_statistics(*scan.labels, num_classes=len(classes), min_points=golden.min_points)
    rows = per_class(total, list(classes))
    assert list(rows) == list(classes)[1:]
    for name, row in rows.items():
        official = classes[name]
        assert (row["tp"], row["fp"], row["fn"]) == (official["tp"], official["fp"], official["fn"])
        assert [row[key] for key in ("pq", "sq", "rq", "iou")] == pytest.approx(
            [official[key] for key in ("PQ", "SQ", "RQ", "IoU")], abs=1e-9
        )
    assert total.iou_sum.tolist() == pytest.approx([row["sum_iou"] for row in classes.values()], abs=1e-9)
    assert total.confusion.tolist() == expected["confusion_rows_pred_cols_gt"]
    return total


def test_two_cars_one_half_found() -> None:
    """Car 1: 4 of 5 points, IoU 4/5. Car 2 is called person: a miss and a false alarm. Road: its point and one more."""
    found = statistics(
        truth=[(5, CAR, 31), (3, CAR, 32), (1, ROAD, 20)],
        pred=[(4, CAR, 39), (1, ROAD, 20), (3, PERSON, 11), (1, ROAD, 20)],
    )
    assert found.tp.tolist() == [0, 0, 0, 1]
    assert found.fp.tolist() == [0, 1, 1, 0]  # the road's IoU is exactly one half, which is no match
    assert found.fn.tolist() == [0, 0, 1, 1]
    assert found.iou_sum.tolist() == [0, 0, 0, 0.8]
    assert found.confusion[CAR].tolist() == [0, 0, 0, 4]
    assert found.confusion[:, CAR].tolist() == [0, 3, 1, 4]
    figures = panoptic_figures(found, THINGS)
    assert figures["pq"] == pytest.approx(0.8 * (1 / 1.5) / 3)
    assert figures["pq_things"] == pytest.approx(0.8 * (1 / 1.5) / 2)
    assert figures["pq_things_present"] == pytest.approx(0.8 * (1 / 1.5))  # no person is there
    assert figures["pq_stuff"] == 0
    assert figures["miou"] == pytest.approx((0 + 1 / 2 + 4 / 8) / 3)
    assert figures["miou_present"] == pytest.approx((1 / 2 + 4 / 8) / 2)
    assert figures["miou_things"] == pytest.approx((0 + 4 / 8) / 2)
    assert figures["pq_dagger"] == pytest.approx((0 + 0.8 * (1 / 1.5) + 1 / 2) / 3)


def test_small_unmatched_segments_do_not_count_but_small_matches_do() -> None:
    found = statistics(truth=[(2, CAR, 31), (2, PERSON, 11)], pred=[(2, CAR, 31), (2, ROAD, 20)], min_points=3)
    assert (found.tp.sum(), found.fp.sum(), found.fn.sum()) == (1, 0, 0)
    figures = panoptic_figures(found, THINGS)
    assert figures["pq_present"] == 1.0
    assert figures["miou_present"] == 0.5


def test_void_truth_counts_for_nothing_and_void_prediction_misses() -> None:
    found = statistics(truth=[(9, 0, 0), (4, CAR, 31)], pred=[(9, ROAD, 20), (4, 0, 0)])
    assert (found.tp.sum(), found.fp.sum()) == (0, 0)
    assert found.fn.tolist() == [0, 0, 0, 1]
    assert class_figures(found).iou.tolist() == [0, 0, 0, 0]


def test_an_empty_scan_adds_nothing() -> None:
    none = torch.zeros(0, dtype=torch.int64)
    empty = panoptic_statistics(none, none, none, none, num_classes=4, min_points=1)
    assert all(int(count.sum()) == 0 for count in (empty.confusion, empty.tp, empty.fp, empty.fn))
    figures = panoptic_figures(empty, THINGS)
    assert figures["pq"] == 0
    assert math.isnan(figures["pq_present"])


def test_float64_even_where_the_default_is_float32() -> None:
    assert statistics(truth=[(3, CAR, 31)], pred=[(3, CAR, 31)]).iou_sum.dtype == torch.float64
    assert class_figures(PanopticStatistics.zeros(3)).pq.dtype == torch.float64


@st.composite
def scans(draw: st.DrawFn) -> tuple[Tensor, ...]:
    """Short scans with few classes and keys, so that collisions, splits and exact halves are common."""
    points = draw(st.integers(0, 40))
    classes, keys = st.integers(0, 3), st.sampled_from([0, 1, 2, 2**16, 2**31 + 1, 2**32 - 2])
    columns = [draw(st.lists(kind, min_size=points, max_size=points)) for kind in (classes, keys, classes, keys)]
    return tuple(torch.tensor(column, dtype=torch.int64) for column in columns)


def assert_same(one: PanopticStatistics, other: PanopticStatistics) -> None:
    assert torch.equal(one.confusion, other.confusion)
    assert torch.equal(one.tp, other.tp)
    assert torch.equal(one.fp, other.fp)
    assert torch.equal(one.fn, other.fn)
    torch.testing.assert_close(one.iou_sum, other.iou_sum, rtol=0, atol=1e-12)


@given(scans(), st.integers(1, 6))
def test_agrees_with_a_pass_per_class(scan: tuple[Tensor, ...], min_points: int) -> None:
    official = OfficialPanoptic(num_classes=4, min_points=min_points)
    official.add(*(column.numpy() for column in scan))
    found = panoptic_statistics(*scan, num_classes=4, min_points=min_points)
    counts = (torch.from_numpy(count) for count in (official.tp, official.fp, official.fn))
    assert_same(
        found, PanopticStatistics(torch.from_numpy(official.confusion), torch.from_numpy(official.iou), *counts)
    )
    figures, expected = class_figures(found), official.class_figures()
    for name in ("pq", "sq", "rq", "iou"):
        assert getattr(figures, name).numpy() == pytest.approx(expected[name], abs=1e-12)


@given(scans(), st.randoms(use_true_random=False))
def test_the_order_of_the_points_does_not_matter(scan: tuple[Tensor, ...], random: object) -> None:
    order = list(range(len(scan[0])))
    random.shuffle(order)  # type: ignore[attr-defined]
    shuffled = (column[order] for column in scan)
    assert_same(panoptic_statistics(*scan, 4, 2), panoptic_statistics(*shuffled, 4, 2))


@given(scans(), st.permutations(range(6)), st.permutations(range(6)))
def test_the_names_of_the_keys_do_not_matter(scan: tuple[Tensor, ...], first: list[int], second: list[int]) -> None:
    names = torch.tensor([0, 1, 2, 2**16, 2**31 + 1, 2**32 - 2])
    pred, truth = torch.searchsorted(names, scan[1]), torch.searchsorted(names, scan[3])
    renamed = (scan[0], names[torch.tensor(first)][pred], scan[2], names[torch.tensor(second)][truth])
    assert_same(panoptic_statistics(*scan, 4, 2), panoptic_statistics(*renamed, 4, 2))


@given(scans(), scans(), scans())
def test_halves_merge_into_the_whole(a: tuple[Tensor, ...], b: tuple[Tensor, ...], c: tuple[Tensor, ...]) -> None:
    one, two, three = (panoptic_statistics(*scan, 4, 2) for scan in (a, b, c))
    assert_same((one + two) + three, PanopticStatistics.zeros(4) + one + (two + three))
