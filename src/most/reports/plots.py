"""Plots of a group of runs: PQ by strategy, against occlusion, distance and points, and membership accuracy.

Axes and texts have one ink that no page has; on the page it becomes the text's colour, in light as in dark.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from most.metrics.bootstrap import Interval
from most.reports.ablations import Ablation
from most.reports.analysis import Analysis
from most.reports.bins import Bins, by_distance, by_points, by_visible

INK = "#010203"
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b8860b", "#56b4e9", "#7a5195")  # Okabe and Ito's, readable
PAIRED = "All rows see the same sequences: whether two differ is told by the table of differences, not by an overlap."
MARKS = ("o", "s", "^", "D", "v", "P", "X")
STYLE: Any = {
    "svg.fonttype": "none", "font.family": "sans-serif", "font.size": 10, "axes.spines.top": False,
    "axes.spines.right": False, "text.color": INK, "axes.labelcolor": INK, "axes.edgecolor": INK,
    "xtick.color": INK, "ytick.color": INK, "axes.facecolor": "none", "figure.facecolor": "none",
    "legend.frameon": False,
}  # fmt: skip


@dataclass(frozen=True)
class Plot:
    """A picture, and its meaning in words."""

    name: str
    title: str
    meaning: str
    svg: str


def plots(ablations: Mapping[str, Ablation], analysis: Analysis) -> list[Plot]:
    """All plots that there are runs for."""
    strategies, ways = ablations["table1"], ablations["table2"]
    measured = analysis.group.measured
    found = [
        _bars("extents", "PQ by extent strategy", strategies, analysis, {"PQ": "pq"}),
        *(_curves(bins, strategies, analysis) for bins in (by_visible(), by_distance(measured), by_points(measured))),
        _bars("membership", "Membership accuracy", ways, analysis,
              {"all": "membership_accuracy", "contested": "membership_accuracy_contested"}),
    ]  # fmt: skip
    return [each for each in found if each is not None]


def _bars(name: str, title: str, ablation: Ablation, analysis: Analysis, keys: dict[str, str]) -> Plot | None:
    """A line for each row: mean and interval, and each seed as a dot."""
    rows = {ablation.title_of(each): ablation.runs(analysis.group, each) for each in ablation.rows.values()}
    found = {row: analysis.cells(runs, keys) for row, runs in rows.items()}
    rows = {row: runs for row, runs in rows.items() if any(found[row].values())}
    if not rows:
        return None
    with mpl.rc_context(STYLE):
        figure, axes = _figure(0.45 * len(rows) * len(keys) + 1)
        for series, (label, key) in enumerate(keys.items()):
            shown = [row for row in rows if found[row][label]]
            for place, (row, runs) in enumerate(rows.items()):
                at = place + 0.25 * (series - (len(keys) - 1) / 2)
                seeds = analysis.by_seed(runs, key).values()
                _bar(axes, at, found[row][label], seeds, series, label if row in shown[:1] else None)
        axes.set_yticks(range(len(rows)), [_plain(row) for row in rows])
        axes.invert_yaxis()
        axes.set_xlabel("%")
        axes.grid(axis="x", alpha=0.2, color=INK)
        if len(keys) > 1:
            axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=len(keys))
        said = "; ".join(f"{row} {_said(found[row])}" for row in rows)
        meaning = f"{title}, with 95 % intervals; small dots are seeds. {said}. {PAIRED}"
        return Plot(name, title, meaning, _svg(figure, name))


def _bar(axes: Axes, at: float, cell: Interval | None, seeds: Iterable[float], series: int, label: str | None) -> None:
    if cell is None:
        return
    values = [100 * value for value in seeds]
    axes.plot(values, [at + 0.12] * len(values), ".", color=COLOURS[series], alpha=0.6, markersize=4)
    low, high = (cell.value if bound is None else bound for bound in (cell.low, cell.high))
    axes.hlines(at, 100 * low, 100 * high, color=COLOURS[series], linewidth=2)
    axes.plot([100 * cell.value], [at], MARKS[series], color=COLOURS[series], label=label, markersize=7)


def _curves(bins: Bins, ablation: Ablation, analysis: Analysis) -> Plot | None:
    """A curve for each row, a point for each bin that has instances, with the interval as a line through it."""
    found = {}
    for each in ablation.rows.values():
        cells = analysis.cells(ablation.runs(analysis.group, each), bins.columns)
        if any(cells.values()):
            found[ablation.title_of(each)] = [cell or Interval(math.nan) for cell in cells.values()]
    if not found:
        return None
    with mpl.rc_context(STYLE):
        figure, axes = _figure(4.0)
        for series, (row, curve) in enumerate(found.items()):
            _curve(axes, row, curve, series, 0.08 * (series - (len(found) - 1) / 2))
        axes.set_xticks(range(len(bins.labels)), bins.labels)
        axes.set_xlabel(bins.axis)
        axes.set_ylabel("PQ, %")
        axes.set_ylim(0, 100)
        axes.grid(axis="y", alpha=0.2, color=INK)
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3)
        meaning = f"{bins.title}: all things together, in bins; lines through points are 95 % intervals. {bins.meaning}"
        return Plot(bins.name, bins.title, meaning, _svg(figure, bins.name))


def _curve(axes: Axes, row: str, cells: Sequence[Interval], series: int, shift: float) -> None:
    colour, mark = COLOURS[series % len(COLOURS)], MARKS[(series + series // len(MARKS)) % len(MARKS)]
    low, high = (
        [100 * (cell.value if bound is None else bound) for cell, bound in zip(cells, bounds, strict=True)]
        for bounds in ([cell.low for cell in cells], [cell.high for cell in cells])
    )
    places = [place + shift for place in range(len(cells))]
    axes.vlines(places, low, high, color=colour, alpha=0.6, linewidth=1.5)
    axes.plot(places, [100 * cell.value for cell in cells], mark + "-", color=colour, label=_plain(row), markersize=5)


def _plain(text: str) -> str:
    """A row's title as it is: between two dollars it would be taken for a formula."""
    return text.replace("$", r"\$")


def _said(cells: Mapping[str, Interval | None]) -> str:
    return ", ".join(f"{100 * cell.value:.1f}" for cell in cells.values() if cell is not None)


def _figure(height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(8, height), layout="constrained")
    return figure, figure.add_subplot()


def _svg(figure: Figure, name: str) -> str:
    """The picture, the same every time; ids begin with its name, so that a page can hold several."""
    buffer = BytesIO()
    with mpl.rc_context({"svg.hashsalt": name, **STYLE}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue().decode()
    return text[text.index("<svg") :]
