"""PQ by how much of an object is seen: worked by hand, on objects along a line."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from most.datasets.taxonomy import Taxonomy
from most.metrics import SplitSums
from most.metrics.overlaps import find_overlaps
from most.metrics.places import Places

CAR, TRUCK, ROAD = 1, 4, 9
TAXONOMY = replace(Taxonomy.load("semantickitti"), min_points=3)
Point = tuple[float, int, int, int, int]  # place along the line, predicted class and id, true class and id


def add(sums: SplitSums, points: list[Point], sequence: str = "08") -> None:
    place, pred, pred_id, truth, truth_id = (torch.tensor(column) for column in zip(*points, strict=True))
    places = torch.stack([place * 0.6, place * 0.8, torch.zeros_like(place)], 1).float()  # a line across the axes
    labels = TAXONOMY.encode(pred, pred_id), TAXONOMY.encode(truth, truth_id)
    sums.update(sequence, (pred, labels[0]), (truth, labels[1]), places)


def line(length: float, pred: int, pred_id: int, truth: int = CAR, truth_id: int = 7) -> list[Point]:
    """Four points of an object from 10 m on."""
    return [(10 + length * part / 3, pred, pred_id, truth, truth_id) for part in range(4)]


def visible(sums: SplitSums, sequence: str = "08") -> dict[str, list[list[float]]]:
    found: dict[str, list[list[float]]] = sums.plain()["sequences"][sequence]["visible"]
    return found


def of_car(sums: SplitSums) -> dict[str, list[float]]:
    return {name: [row[CAR] for row in rows] for name, rows in visible(sums).items()}


def test_an_object_counts_where_its_length_stands_to_its_longest() -> None:
    """Found whole (4 m), then missed at 1 m: a quarter of it. In which order they come does not matter."""
    scans = [line(4, CAR, 1), line(1, ROAD, 0)]
    for order in (scans, scans[::-1]):
        sums = SplitSums(TAXONOMY)
        for scan in order:
            add(sums, scan)
        assert of_car(sums) == {"tp": [0, 0, 0, 0, 1], "fp": [0] * 5, "fn": [0, 1, 0, 0, 0], "iou": [0, 0, 0, 0, 1.0]}


def test_another_sequence_has_other_objects_and_an_object_that_is_there_once_is_left_out() -> None:
    sums = SplitSums(TAXONOMY)
    add(sums, line(4, CAR, 1))
    add(sums, line(1, CAR, 1), sequence="09")
    assert of_car(sums)["tp"] == [0] * 5
    add(sums, line(4, CAR, 1, CAR, 8))  # another object of the sequence
    assert of_car(sums)["tp"] == [0] * 5


def test_a_false_segment_counts_for_the_object_that_it_has_most_points_of() -> None:
    """Of eight points at 2 m of a 4 m car, three are said to be a second car: false. One of stuff's is nobody's."""
    whole = line(4, CAR, 1)
    halves = line(2, CAR, 1) + line(2, CAR, 1)[:1] + line(2, CAR, 2)[:3]
    nobodys = [(50.0 + step, CAR, 3, ROAD, 0) for step in range(4)]
    sums = SplitSums(TAXONOMY)
    add(sums, whole)
    add(sums, halves + nobodys)
    assert of_car(sums) == {
        "tp": [0, 0, 1, 0, 1], "fp": [0, 0, 1, 0, 0], "fn": [0] * 5, "iou": [0, 0, 5 / 8, 0, 1.0],
    }  # fmt: skip
    assert sums.plain()["sequences"]["08"]["fp"][CAR] == 2  # officially both


def test_too_small_a_segment_counts_no_more_than_officially_and_points_without_an_instance_are_no_object() -> None:
    sums = SplitSums(TAXONOMY)
    for length in (4.0, 1.0):
        add(sums, line(length, ROAD, 0)[:2] + line(length, ROAD, 0, TRUCK, 0))
    assert of_car(sums)["fn"] == [0] * 5
    assert sum(row[TRUCK] for row in visible(sums)["fn"]) == 0
    assert sums.plain()["sequences"]["08"]["fn"][TRUCK] == 2


def test_lengths_are_from_end_to_end_in_any_direction_to_a_percent() -> None:
    random = np.random.default_rng(3)
    places = torch.from_numpy(random.normal(0, 3, (60, 3)))
    truth = torch.full((60,), CAR), torch.from_numpy(random.integers(1, 4, 60))
    overlaps = find_overlaps(*truth, *truth)
    lengths = Places.of(places, overlaps, truth, truth, TAXONOMY.things).lengths
    for key, length in zip(overlaps.truth.keys, lengths, strict=True):
        own = places[truth[1] == key, :2]
        assert length == pytest.approx(float(torch.cdist(own, own).max()), rel=0.009)
        assert length <= float(torch.cdist(own, own).max()) + 1e-9
