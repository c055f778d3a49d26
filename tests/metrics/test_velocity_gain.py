"""What velocities are worth: intervals, links, errors and tables, by hand."""

import pytest
import torch

from most.errors import DataError
from most.metrics.links import Links
from most.metrics.paired import paired_difference
from most.metrics.velocities import VelocityErrors, is_moving, velocity_errors
from most.metrics.velocity_gain import mean_gain
from most.metrics.velocity_table import format_velocity_gain
from most.structures import Detections, Instances


def test_two_sequences_say_little() -> None:
    """Draws of 0.1 and 0.3 reach from one to the other; Student's 12.71 for 1.96, and variance by n - 1."""
    found = paired_difference([0.5, 0.9], [0.4, 0.6])
    wide = 0.1 * 12.706 / 1.960 * 2**0.5
    assert (found.value, found.low, found.high) == pytest.approx((0.2, 0.2 - wide, 0.2 + wide), rel=0.03)


def test_pairs_count_not_levels() -> None:
    """The same gain everywhere is certain, however much sequences differ."""
    found = paired_difference([0.1, 0.5, 0.9], [0.0, 0.4, 0.8])
    assert (found.value, found.low, found.high) == pytest.approx((0.1, 0.1, 0.1))


def test_the_interval_is_the_same_in_every_run_and_close_to_students() -> None:
    """For 100 differences of mean 1 and standard deviation 2, 1.96 standard errors are 0.392."""
    values = torch.linspace(-1, 1, 100, dtype=torch.float64).erfinv().nan_to_num(posinf=2.0, neginf=-2.0)
    values = 1 + 2 * (values - values.mean()) / values.std()
    found = paired_difference(values.tolist(), [0.0] * 100)
    assert found == paired_difference(values.tolist(), [0.0] * 100)
    assert (found.low, found.high) == pytest.approx((1 - 0.392, 1 + 0.392), abs=0.03)


def test_a_sequence_without_a_figure_counts_in_no_mean() -> None:
    found = mean_gain([0.5, float("nan"), 0.7], [0.4, 0.9, 0.6])
    assert (found["velocity"], found["nearest"], found["difference"]) == pytest.approx((0.6, 0.5, 0.1))


@pytest.mark.parametrize("figures", [[], [0.5], [0.5, float("nan")]])
def test_an_interval_needs_two_sequences_and_numbers(figures: list[float]) -> None:
    with pytest.raises(DataError, match="two sequences or more"):
        paired_difference(figures, [0.0] * len(figures))


def test_links_join_what_is_found_in_both_scans() -> None:
    """The first object keeps its identity, the second changes it; the third is new, and the fourth is gone."""
    before, now = {(1, 1): 7, (1, 2): 8, (2, 4): 9}, {(1, 1): 7, (1, 2): 9, (2, 3): 8}
    assert Links.between(before, now) == Links(kept=1, switched=1)
    assert Links(1, 2) + Links(3, 4) == Links(4, 6)


def truth(*velocities: tuple[float, float], known: list[bool] | None = None) -> Instances:
    """Cars 10 m apart along x."""
    count = len(velocities)
    return Instances(
        keys=torch.arange(count) + 1,
        classes=torch.ones(count, dtype=torch.int64),
        counts=torch.full((count,), 50),
        centres=torch.stack([torch.arange(count) * 10.0, torch.zeros(count), torch.zeros(count)], 1),
        extents=torch.ones(count, 3),
        velocities=torch.tensor(velocities).reshape(-1, 2),
        velocity_known=torch.tensor(known or [True] * count),
    )


def detections(*rows: tuple[float, float, float], thing: int = 1) -> Detections:
    """At (x, 0) with a velocity."""
    table = torch.tensor(rows).reshape(-1, 3)
    count = len(rows)
    return Detections(
        classes=torch.full((count,), thing),
        scores=torch.full((count,), 0.5),
        centres=torch.cat([table[:, :1], torch.zeros(count, 2)], 1),
        extents=torch.ones(count, 3),
        velocities=table[:, 1:],
    )


def test_errors_are_those_of_moving_objects_that_were_detected() -> None:
    """Of four cars the second stands, the third's velocity is unknown, and the fourth is not detected."""
    cars = truth((6.0, 8.0), (0.5, 0.5), (5.0, 0.0), (9.0, 0.0), known=[True, True, False, True])
    assert is_moving(cars).tolist() == [True, False, False, True]
    found = detections((0.2, 3.0, 4.0), (10.0, 4.0, 4.0), (20.0, 4.0, 4.0))
    errors = velocity_errors(found, torch.ones(3, 3), cars)
    assert errors.summary() == {"objects": 1, "predicted": 5.0, "zero": 10.0}
    nobody = velocity_errors(detections((0.0, 6.0, 8.0), thing=2), torch.ones(1, 3), cars)
    assert len(nobody) == 0
    unknown = detections((0.2, float("nan"), float("nan")), (30.0, 9.0, 1.0))
    assert velocity_errors(unknown, torch.ones(2, 3), cars).errors.tolist() == [1.0]
    both = VelocityErrors.cat([errors, velocity_errors(detections((30.0, 9.0, 1.0)), torch.ones(1, 3), cars)])
    assert both.summary() == pytest.approx({"objects": 2, "predicted": 3.0, "zero": 9.5})


def test_tables_say_what_was_measured() -> None:
    links = {"velocity": {"kept": 9, "switched": 1}, "nearest": {"kept": 6, "switched": 4}}
    error = {"objects": 4, "predicted": 1.5, "zero": 6.0}
    printed = format_velocity_gain(
        {
            "scans": 8,
            "sequences": {"a": {"velocity": 0.5, "nearest": 0.4}, "b": {"velocity": 0.7, "nearest": 0.4}},
            "lstq": {"velocity": 0.6, "nearest": 0.4, "difference": 0.2, "low": 0.1, "high": 0.3},
            "links": {"all": links, "moving": links},
            "velocity_error": error | {"per_class": {"car": error}},
        }
    )
    lines = [" ".join(line.split()) for line in printed.splitlines()]
    assert "| b | 40.0 | 70.0 | +30.0 |" in lines
    assert "| LSTQ, mean | 40.0 | 60.0 | +20.0 (95 %: +10.0 to +30.0) |" in lines
    assert "| links kept | 6 of 10 | 9 of 10 | +30.0 |" in lines
    assert "| car | 4 | 1.50 | 6.00 | 0.25 |" in lines
