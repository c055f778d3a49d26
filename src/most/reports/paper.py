"""The paper's own figures (``paper.yaml``), as blocks of tables."""

from functools import cache
from pathlib import Path
from typing import Any

import yaml

from most.metrics.bootstrap import Interval
from most.reports.table import Block, Row


@cache
def _content() -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load((Path(__file__).parent / "paper.yaml").read_text())
    return content


def paper_block(name: str) -> Block:
    """The rows of one of the paper's tables; its dashes are None."""
    table = _content()[name]
    rows = tuple(
        Row(title, {column: _cell(value) for column, value in zip(table["columns"], values, strict=True)})
        for title, values in table["rows"].items()
    )
    return Block(f"The paper's own figures: {table['dataset']}", rows, ours=False)


def paper_figure(name: str, title: str, column: str) -> float | None:
    """One figure, a fraction; None where the table has none."""
    table = _content()[name]
    if column not in table["columns"]:
        return None
    return float(table["rows"][title][table["columns"].index(column)]) / 100


def _cell(value: float | None) -> Interval | None:
    return None if value is None else Interval(value / 100)
