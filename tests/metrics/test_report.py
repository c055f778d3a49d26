"""Reports: JSON without NaN, and a table of percentages."""

import json
import math
from pathlib import Path

import pytest
import torch

from most.metrics.panoptic import PanopticStatistics, panoptic_figures, per_class
from most.metrics.report import format_table, write_report

NAMES = ["void", "road", "car", "person"]


@pytest.fixture
def panoptic() -> dict:
    """One car found with IoU 0.75 and one missed, a road of IoU 1, no person anywhere."""
    statistics = PanopticStatistics.zeros(4)
    statistics.tp = torch.tensor([0, 1, 1, 0])
    statistics.fn = torch.tensor([0, 0, 1, 0])
    statistics.iou_sum = torch.tensor([0, 1, 0.75, 0], dtype=torch.float64)
    statistics.confusion = torch.diag(torch.tensor([0, 10, 3, 0]))
    statistics.confusion[0, 2] = 1
    unknown = {"membership_accuracy": 0.8125, "membership_accuracy_contested": None}
    return panoptic_figures(statistics, [2, 3]) | unknown | {"per_class": per_class(statistics, NAMES)}


def test_what_is_not_a_number_is_null(tmp_path: Path) -> None:
    path = tmp_path / "new" / "metrics.json"
    write_report(path, {"scans": 1, "panoptic": {"pq": math.nan, "sq": 0.5, "per_class": {"car": {"pq": math.nan}}}})
    expected = {"scans": 1, "panoptic": {"pq": None, "sq": 0.5, "per_class": {"car": {"pq": None}}}}
    assert json.loads(path.read_text()) == expected


def test_floats_survive_to_the_last_digit(tmp_path: Path) -> None:
    write_report(tmp_path / "metrics.json", {"pq": 1 / 3})
    assert json.loads((tmp_path / "metrics.json").read_text())["pq"] == 1 / 3


def test_the_table(panoptic: dict) -> None:
    rows = {
        line.split("  ")[0].strip(): line.split() for line in format_table(panoptic, ["car", "person"]).splitlines()
    }
    assert rows["car"] == ["car", "50.0", "75.0", "66.7", "75.0", "1", "0", "1"]
    assert rows["person"] == ["person", "-", "-", "-", "-", "0", "0", "0"]
    assert rows["road"][1:5] == ["100.0"] * 4
    assert rows["all"] == ["all", "50.0", "58.3", "55.6", "58.3"]
    assert rows["all present"] == ["all", "present", "75.0", "87.5", "83.3", "87.5"]
    assert rows["things"][1] == "25.0"
    assert rows["PQ dagger"] == ["PQ", "dagger", "50.0"]  # car 50, person 0, road's IoU 100
    assert rows["membership"] == ["membership", "81.2"]
    names = list(rows)
    assert names.index("car") < names.index("person") < names.index("road") < names.index("all")


def test_what_is_unknown_shows_a_dash(panoptic: dict) -> None:
    lines = format_table(panoptic, ["car", "person"]).splitlines()
    assert lines[-1].split() == ["contested", "-"]
    assert len({len(line) for line in lines[:2]}) == 1
