"""Reports side by side, and how much higher each is than the first: with intervals over the split's sequences."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float64

from most.metrics.bootstrap import CONFIDENCE, Interval, Resampling
from most.reports.figures import Figures, Presence, figures
from most.reports.sums import Sums, read_sums
from most.reports.table import between, percent

COMPARED = {
    "PQ": "pq",
    "PQ present": "pq_present",
    "PQ things": "pq_things",
    "mIoU": "miou",
    "LSTQ": "lstq",
    "PAT": "pat",
    "membership": "membership_accuracy",
    "contested": "membership_accuracy_contested",
}
Reports = Mapping[str, Mapping[str, Any]]  # what most.evaluate or most.train wrote, by name


def format_figures(reports: Reports) -> str:
    """The main figures in percent, a line for each report; those that none has are left out."""
    found = {name: _known(report) for name, report in reports.items()}
    columns = {title: key for title, key in COMPARED.items() if any(key in known for known in found.values())}
    rows = [["", *columns]]
    rows += [[name, *(percent(known.get(key)) for key in columns.values())] for name, known in found.items()]
    return _aligned(rows)


def format_differences(reports: Reports, draws: int = 10_000) -> str:
    """How much higher the figures are than the first report's, a column for each of the others.

    Intervals are those of the paired bootstrap over sequences: what other sequences would have given, with the same
    trained networks. What cannot be compared is said in a line.
    """
    (first, base), *others = ((name, _sums(name, report)) for name, report in reports.items())
    said, columns = [], {}
    for name, sums in others:
        if base is None or sums is None:
            said.append(f"{name}: no differences to {first}: a report has no sums of sequences; score it again")
        elif base.measured != sums.measured:
            said.append(f"{name}: no differences to {first}: they were not scored on the same scans")
        else:
            columns[name] = _differences(base, sums, draws)
    if base is not None and columns:
        titles = [title for title, key in COMPARED.items() if any(key in found for found in columns.values())]
        rows = [[f"minus {first}", *columns]]
        rows += [[title, *(_cell(found.get(COMPARED[title])) for found in columns.values())] for title in titles]
        sequences = len(base.measured.sequences)
        over = f"in brackets: {CONFIDENCE:.0%} intervals over the {sequences} sequences; one training each"
        said = [_aligned(rows), *([over] if sequences > 1 else []), *said]
    return "\n".join(said)


def _known(report: Mapping[str, Any]) -> dict[str, Interval]:
    """The figures of a report that are numbers."""
    values = {**report["panoptic"], **(report.get("lstq") or {}), **(report.get("tracking") or {})}
    known = {key: values[key] for key in COMPARED.values() if values.get(key) is not None}
    return {key: Interval(float(value)) for key, value in known.items() if math.isfinite(value)}


def _sums(name: str, report: Mapping[str, Any]) -> Sums | None:
    section = report["panoptic"].get("sums")
    return None if section is None else read_sums(section, name)


def _differences(base: Sums, sums: Sums, draws: int) -> dict[str, Interval]:
    """By key; figures that either report does not have are left out."""
    resampling, presence = Resampling(len(base.measured.sequences), draws), Presence.of([base, sums])
    if not _same_regions(base, sums):
        base = replace(base, membership=None)
    ours, theirs = (figures(each, presence, resampling.of_sequences()) for each in (sums, base))
    found = {
        key: resampling.interval(_drawn(ours, theirs, key), (-1, 1))
        for key in COMPARED.values()
        if key in ours and key in theirs
    }
    return {key: interval for key, interval in found.items() if math.isfinite(interval.value)}


def _same_regions(base: Sums, sums: Sums) -> bool:
    """Whether membership accuracies are over as many points: those of other detections are not."""
    if base.membership is None or sums.membership is None:
        return False
    return np.array_equal(base.membership[:, 1::2], sums.membership[:, 1::2])


def _drawn(ours: Figures, theirs: Figures, key: str) -> Float64[np.ndarray, "draws 1"]:
    return (ours[key] - theirs[key])[:, None]


def _cell(interval: Interval | None) -> str:
    inside = between(interval, signed=True)
    return percent(interval, signed=True) + (f" ({inside})" if inside else "")


def _aligned(rows: list[list[str]]) -> str:
    """Columns of even width, the first to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join([first.ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(rest, widths[1:], strict=True))])
        for first, *rest in rows
    ]
    return "\n".join(line.rstrip() for line in lines)
