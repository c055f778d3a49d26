"""The ladder as a table to read: figures, and what is missing to either end."""

from collections.abc import Mapping
from typing import Any

from most.ladder.rungs import EVERYTHING, MODEL

PANOPTIC = {"PQ": "pq", "PQ Th": "pq_things", "mIoU": "miou"}
SEQUENCES = {"LSTQ": "lstq", "LSTQ rep.": "lstq_repaired", "PAT": "pat", "PAT rep.": "pat_repaired"}

Figures = dict[str, float]


def format_ladder(rungs: Mapping[str, Mapping[str, Any]]) -> str:
    """Figures of every rung in percent; below, the differences to everything substituted, and to the model as it is."""
    rows = {name: _figures(report) for name, report in rungs.items()}
    blocks = [_block("", rows)]
    for reference, title in {EVERYTHING: "minus everything", MODEL: "minus the model"}.items():
        if reference in rows:
            blocks.append(_block(title, {name: _minus(row, rows[reference]) for name, row in rows.items()}, "+"))
    return "\n\n".join(blocks)


def _figures(report: Mapping[str, Any]) -> Figures:
    sequences = report.get("tracking") or report["lstq"]
    figures = {title: report["panoptic"][key] for title, key in PANOPTIC.items()}
    return figures | {title: sequences[key] for title, key in SEQUENCES.items() if key in sequences}


def _minus(row: Figures, other: Figures) -> Figures:
    return {title: value - other[title] for title, value in row.items()}


def _block(title: str, rows: Mapping[str, Figures], sign: str = "") -> str:
    width = max(map(len, rows))
    columns = list(next(iter(rows.values())))
    lines = [f"{title:<{width}}" + "".join(f"{column:>11}" for column in columns)]
    lines += [
        f"{name:<{width}}" + "".join(_percent(row[column], sign) for column in columns) for name, row in rows.items()
    ]
    return "\n".join(lines)


def _percent(value: float, sign: str) -> str:
    return f"{'-':>11}" if value != value else f"{100 * value:>{sign}11.2f}"
