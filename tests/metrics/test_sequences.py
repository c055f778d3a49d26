"""The 4D sections of a report: which evaluator speaks for which dataset, worked out by hand."""

from dataclasses import replace

import pytest
import torch

from most.datasets.taxonomy import Taxonomy
from most.metrics.sequences import SequenceScores


def one_car(name: str, *ids: int) -> dict:
    """The report of a car of 60 points, alone in the world; ``ids`` are those predicted, scan after scan."""
    taxonomy = Taxonomy.load(name)
    car = taxonomy.class_names.index("car")
    scores, classes = SequenceScores(taxonomy), torch.full((60,), car)
    truth = taxonomy.label.join(torch.full((60,), taxonomy.raw_ids[car][0]), torch.full((60,), 1))
    for number in ids:
        scores.update("a", classes, taxonomy.encode(classes, torch.full((60,), number)), classes, truth)
    return scores.report()


def test_a_car_that_keeps_its_id_is_tracked_perfectly():
    lstq = one_car("semantickitti", 5, 5)["lstq"]
    assert (lstq["lstq"], lstq["s_assoc"], lstq["s_cls"]) == (1, 1, 1)
    assert lstq["per_class"]["car"]["tubes"] == 1
    tracking = one_car("nuscenes", 5, 5)["tracking"]
    assert tracking["s_assoc"] == pytest.approx(1)
    assert tracking["per_class"]["car"]["switches"] == 0


def test_a_car_whose_id_changes_is_two_half_tubes():
    """Each of the two predicted tubes has 60 of the 120 points and an IoU of one half."""
    lstq = one_car("semantickitti", 5, 6)["lstq"]
    assert lstq["s_assoc"] == pytest.approx((60 * 0.5 + 60 * 0.5) / 120)
    assert lstq["lstq"] == pytest.approx(0.5**0.5)
    assert one_car("nuscenes", 5, 6)["tracking"]["per_class"]["car"]["switches"] == 1


@pytest.mark.filterwarnings("ignore:The ``compute`` method")  # of torchmetrics: before any update
def test_the_taxonomy_names_the_evaluator_whatever_the_dataset_is_called():
    taxonomy = replace(Taxonomy.load("semantickitti"), name="simulated", evaluator="nuscenes")
    assert set(SequenceScores(taxonomy).report()) == {"tracking"}
