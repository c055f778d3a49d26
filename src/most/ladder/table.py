"""The ladder as a table to read: figures, and what is missing to either end."""

from collections.abc import Mapping
from typing import Any

from most.ladder.ceilings import CEILING
from most.ladder.rungs import EVERYTHING, MODEL

PANOPTIC = {"PQ": "pq", "PQ Th": "pq_things", "mIoU": "miou"}
SEQUENCES = {"LSTQ": "lstq", "LSTQ rep.": "lstq_repaired", "PAT": "pat", "PAT rep.": "pat_repaired"}

Figures = dict[str, float]


def format_ladder(rows: Mapping[str, Mapping[str, Any]]) -> str:
    """Figures of every row in percent; below, how far rungs are from everything substituted and from the model."""
    table = {name: _figures(report) for name, report in rows.items()}
    blocks = [_block("", table)]
    for end in (EVERYTHING, MODEL):
        if end in table:
            others = [name for name in table if name != end and not name.startswith(CEILING)]
            blocks.append(_block(f"minus {end}", {name: _minus(table[name], table[end]) for name in others}, "+"))
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
