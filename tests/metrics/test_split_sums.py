"""Sums by sequence: worked by hand, additive to the last bit, and the official figures when all are put together."""

import json
import random
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from torch import Tensor

from golden_cases import FOLDER, read_golden
from most.datasets.taxonomy import Taxonomy
from most.metrics import MembershipCounts, SplitSums
from most.metrics.report import write_report

CAR, ROAD = 1, 9
TAXONOMY = replace(Taxonomy.load("semantickitti"), min_points=3)


def sums_of(*scans: tuple[str, list[tuple[float, int, int, int, int]]]) -> SplitSums:
    """Scans by sequence; a point is (x, predicted class, its id, true class, its id), and lies at y = 0."""
    sums = SplitSums(TAXONOMY)
    for sequence, points in scans:
        x, pred, pred_id, truth, truth_id = (torch.tensor(column) for column in zip(*points, strict=True))
        places = torch.stack([x, torch.zeros_like(x), torch.zeros_like(x)], 1).float()
        labels = TAXONOMY.encode(pred, pred_id), TAXONOMY.encode(truth, truth_id)
        sums.update(sequence, (pred, labels[0]), (truth, labels[1]), places, MembershipCounts(1, 2, 3, 4))
    return sums


def test_every_segment_counts_in_the_bin_of_its_place_and_of_its_size() -> None:
    """Four points of a car near 5 m, three of them found; a car of two at 12 m missed; a false one of three at 60 m."""
    near = [(4.0, CAR, 1, CAR, 1)] * 3 + [(8.0, ROAD, 0, CAR, 1)]
    small = [(12.0, ROAD, 0, CAR, 2)] * 2
    false = [(60.0, CAR, 3, ROAD, 0)] * 3
    section = sums_of(("08", near + small + false)).plain()
    of = section["sequences"]["08"]
    assert (of["tp"][CAR], of["fp"][CAR], of["fn"][CAR], of["iou"][CAR]) == (1, 1, 0, 0.75)  # two points are too few
    assert (of["intersection"][CAR], of["predicted"][CAR], of["true"][CAR]) == (3, 6, 6)
    assert of["membership"] == [1, 2, 3, 4]
    assert [row[CAR] for row in of["distance"]["tp"]] == [1, 0, 0, 0, 0, 0]  # its mean is at 5 m
    assert [row[CAR] for row in of["distance"]["fn"]] == [0] * 6
    assert [row[CAR] for row in of["distance"]["fp"]] == [0, 0, 0, 0, 0, 1]
    assert of["points"]["fn"][0][CAR] == 1  # the small one counts here
    assert of["distance"]["iou"][0][CAR] == of["points"]["iou"][0][CAR] == 0.75
    assert all(row[ROAD] == 0 for row in of["distance"]["fp"] + of["points"]["tp"])


def golden_sums(order: list[int], points: bool = True) -> SplitSums:
    taxonomy = Taxonomy.load("semantickitti")
    sums, scans = SplitSums(taxonomy), read_golden(FOLDER / "semantickitti_pq" / "main.json").scans
    for index in order:
        pred, pred_key, truth, truth_key = scans[index].labels
        places = torch.randn(len(pred), 3, generator=torch.Generator().manual_seed(index)) * 20
        sums.update(f"{scans[index].sequence}", (pred, pred_key), (truth, truth_key), places if points else None)
    return sums


def count() -> int:
    return len(read_golden(FOLDER / "semantickitti_pq" / "main.json").scans)


def test_distances_part_the_official_sums_of_things_and_order_does_not_matter() -> None:
    order = list(range(count()))
    whole, mixed = golden_sums(order), golden_sums(random.Random(1).sample(order, len(order)))
    assert whole.plain() == mixed.plain()  # to the last bit
    for of in whole.plain()["sequences"].values():
        for name in ("tp", "fp", "fn", "iou"):
            things = torch.tensor(of[name], dtype=torch.float64)[TAXONOMY.things]
            parts = torch.tensor(of["distance"][name], dtype=torch.float64).sum(0)[TAXONOMY.things]
            torch.testing.assert_close(parts, things, rtol=1e-12, atol=0)


def test_together_they_are_the_official_figures() -> None:
    expected = json.loads((FOLDER / "semantickitti_pq" / "main.json").read_text())["expected"]["pq"]["overall"]
    figures = golden_sums(list(range(count())), points=False).figures()
    assert figures["pq"] == pytest.approx(expected["pq_mean"], abs=1e-9)
    assert figures["miou"] == pytest.approx(expected["iou_mean"], abs=1e-9)
    assert figures["membership_accuracy"] is None


def test_what_one_scan_does_not_know_the_sequence_does_not_know() -> None:
    sums = sums_of(("08", [(1.0, CAR, 1, CAR, 1)]))
    labels: Tensor = TAXONOMY.encode(torch.tensor([CAR]), torch.tensor([1]))
    sums.update("08", (torch.tensor([CAR]), labels), (torch.tensor([CAR]), labels))
    of = sums.plain()["sequences"]["08"]
    assert of["scans"] == 2
    assert of["distance"] is of["visible"] is of["membership"] is None


def test_a_list_of_numbers_takes_one_line_and_reads_back(tmp_path: Path) -> None:
    section = sums_of(("08", [(1.0, CAR, 1, CAR, 1)])).plain()
    write_report(tmp_path / "metrics.json", {"sums": section})
    text = (tmp_path / "metrics.json").read_text()
    assert json.loads(text)["sums"] == section
    assert len(text.splitlines()) < 150
