"""Figures of resamples are those of the metrics, formed of the sums of the sequences that were drawn."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from golden_cases import FOLDER, read_golden
from most.datasets.taxonomy import Taxonomy
from most.metrics import MembershipCounts, panoptic_figures, per_class
from most.metrics.sequences import LabelScores
from most.reports.figures import Presence, figures
from most.reports.sums import Sums, read_sums


@pytest.fixture(scope="module", params=["semantickitti", "nuscenes"])
def scores(request: pytest.FixtureRequest) -> LabelScores:
    """Golden scans in two made-up sequences, with made-up places and memberships."""
    found = LabelScores(Taxonomy.load(request.param))
    part = "semantickitti_lstq" if request.param == "semantickitti" else "nuscenes_pat_lstq"
    for index, scan in enumerate(read_golden(FOLDER / part / "main.json").scans):
        pred, pred_key, truth, truth_key = scan.labels
        places = torch.randn(len(pred), 3, generator=torch.Generator().manual_seed(index)) * 30
        found.update(str(scan.sequence % 2), pred, pred_key, truth, truth_key, places, MembershipCounts(3, 4, 1, 2))
    return found


def sums_of(scores: LabelScores) -> Sums:
    return read_sums(json.loads(json.dumps(scores.plain_sums())), "golden")


def test_each_sequence_once_gives_the_figures_of_the_metrics(scores: LabelScores) -> None:
    sums, report = sums_of(scores), scores.report()
    found = figures(sums, Presence.of([sums]), np.ones((1, 2)))
    official = scores.sums.figures()
    for name, value in official.items():
        if name != "per_class" and name in found:
            assert found[name][0] == pytest.approx(value, rel=1e-12), name
    assert set(panoptic_figures(scores.sums.together().statistics(), scores.sums.taxonomy.things)) <= found.keys()
    for name, row in official["per_class"].items():
        assert found.get(f"pq/{name}", [0.0])[0] == pytest.approx(row["pq"], rel=1e-12)
    tracking = report.get("lstq") or report["tracking"]
    for name in ("lstq", "s_assoc", "s_cls", *(("ptq", "tq", "pat") if "tracking" in report else ())):
        assert found[name][0] == pytest.approx(tracking[name], rel=1e-9), name
    assert found["membership_accuracy"][0] == 0.75
    assert found["membership_accuracy_contested"][0] == 0.5


def test_a_draw_is_what_its_sequences_add_up_to(scores: LabelScores) -> None:
    sums = sums_of(scores)
    drawn = figures(sums, Presence.of([sums]), np.array([[2.0, 0.0]]))
    (first, second) = (scores.sums.sequences[name].statistics() for name in ("0", "1"))
    assert first.tp.sum() != second.tp.sum()
    twice = first + first
    seen = per_class(twice, scores.sums.taxonomy.class_names)
    for name, row in seen.items():
        if row["tp"] + row["fn"]:
            assert drawn[f"pq/{name}"][0] == pytest.approx(row["pq"])
    assert drawn["pq_present"][0] == pytest.approx(panoptic_figures(twice, scores.sums.taxonomy.things)["pq_present"])


def test_a_class_that_a_draw_has_not_is_left_out_and_one_that_nobody_has_counts_0() -> None:
    """Two things: the first found perfectly in both sequences, the second missed, and in the second sequence alone."""
    section = {
        "evaluator": "nuscenes", "classes": ["void", "a", "b", "c", "s"], "things": [1, 2, 3], "min_points": 1,
        "distance_edges": [0], "points_edges": [1],
        "sequences": {name: {
            "scans": 1, "tp": [0, 1, 0, 0, 1], "fp": [0] * 5, "fn": [0, 0, lost, 0, 0], "iou": [0, 1, 0, 0, 1],
            "intersection": [0, 9, 0, 0, 9], "predicted": [0, 9, 0, 0, 9], "true": [0, 9, 9 * lost, 0, 9],
            "membership": None, "distance": None,
            "points": {"tp": [[0, 1, 0, 0, 1]], "fp": [[0] * 5], "fn": [[0] * 5], "iou": [[0.0] * 5]},
        } for name, lost in (("1", 0), ("2", 1))},
    }  # fmt: skip
    sums = read_sums(section, "example")
    found = figures(sums, Presence.of([sums]), np.array([[1.0, 1.0], [2.0, 0.0], [0.0, 2.0]]))
    assert found["pq_things"] == pytest.approx([1 / 3, 1 / 2, 1 / 3])  # c counts 0 always, b where it was drawn
    assert found["pq_things_present"] == pytest.approx([1 / 2, 1, 1 / 2])
    assert found["miou"] == pytest.approx([2 / 4, 2 / 3, 2 / 4])
    assert "membership_accuracy" not in found
    assert "distance/0" not in found
    other = replace(sums, counts=sums.counts[::-1].copy())
    both = Presence.of([sums, other])
    assert both.segments.all(0).tolist() == [False, True, True, False, True]  # what one run sees is there for all
