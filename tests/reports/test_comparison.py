"""Reports side by side say how sure a difference is."""

import re
from typing import Any

import pytest

from example_runs import example_sums
from most.reports.comparison import format_differences, format_figures


def report(sums: dict[str, Any] | None = None, **figures: Any) -> dict[str, Any]:
    tracking = {"lstq": {"lstq": figures.pop("lstq")}} if "lstq" in figures else {}
    return {"panoptic": figures | ({} if sums is None else {"sums": sums}), **tracking}


def with_memberships(*correct: int, of: int = 100) -> dict[str, Any]:
    """Sums of as many sequences, alike in all but the points given to the right instance."""
    sums = example_sums(0.7, seed=1, sequences=tuple(f"{index:02}" for index in range(len(correct))))
    for sequence, count in zip(sums["sequences"].values(), correct, strict=True):
        sequence["membership"] = [count, of, 0, 0]
    return sums


def test_figures_are_in_percent_and_those_that_none_has_are_left_out() -> None:
    table = format_figures(
        {"a": report(pq=0.5, miou=None, lstq=0.25), "longer": report(pq=0.125, pq_things=float("nan"))}
    )
    assert [line.split() for line in table.splitlines()] == [
        ["PQ", "LSTQ"],
        ["a", "50.0", "25.0"],
        ["longer", "12.5", "-"],
    ]
    assert len({len(line) for line in table.splitlines()}) == 1


def test_a_difference_that_all_sequences_share_has_no_width() -> None:
    found = format_differences({"a": report(with_memberships(60, 80, 70)), "b": report(with_memberships(63, 83, 73))})
    lines = {line.split("  ")[0]: line for line in found.splitlines()}
    assert lines["membership"].endswith("+3.0 (+3.0 to +3.0)")
    assert lines["PQ"].endswith("+0.0 (+0.0 to +0.0)")
    assert "contested" not in lines  # 0 of 0
    assert "3 sequences" in found


def test_intervals_are_those_of_the_drawn_sequences_and_signed_towards_the_first() -> None:
    """Differences of -2, -4 and -6 points: Student's interval for three is -4 -+ 4.303 * 2 / sqrt(3)."""
    found = format_differences({"a": report(with_memberships(60, 70, 80)), "b": report(with_memberships(58, 66, 74))})
    (line,) = (line for line in found.splitlines() if line.startswith("membership"))
    value, low, high = map(float, re.findall(r"[-+][\d.]+", line))
    assert (value, low, high) == pytest.approx((-4, -4 - 4.97, -4 + 4.97), abs=0.6)


def test_accuracies_over_other_regions_have_no_difference() -> None:
    found = format_differences({"a": report(with_memberships(60, 80)), "b": report(with_memberships(60, 80, of=90))})
    assert "PQ" in found
    assert "membership" not in found


def test_one_sequence_says_nothing_of_others() -> None:
    found = format_differences({"a": report(with_memberships(60)), "b": report(with_memberships(70))})
    assert "+10.0" in found
    assert "(" not in found


@pytest.mark.parametrize(
    ("other", "reason"),
    [
        (report(pq=0.5), "no sums of sequences"),
        (report(with_memberships(60, 70, 80)), "not scored on the same scans"),
    ],
)
def test_what_cannot_be_compared_is_said_beside_what_can(other: dict[str, Any], reason: str) -> None:
    sums = with_memberships(60, 80)
    found = format_differences({"a": report(sums), "b": other, "c": report(sums)})
    assert any(line.startswith("b: ") and reason in line for line in found.splitlines())
    assert found.splitlines()[0].split() == ["minus", "a", "c"]
