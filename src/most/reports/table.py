"""A table's content, whoever lays it out: blocks of rows, each cell a figure with its interval, as fractions."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from most.metrics.bootstrap import Interval

Cells = dict[str, Interval | None]  # by column; None is what is not known


@dataclass(frozen=True)
class Row:
    """One row."""

    title: str
    cells: Cells
    parts: Sequence[Sequence[int]] = ()  # seeds of ours, those that stand on one stage 1 together

    @property
    def seeds(self) -> list[int]:
        """All of them."""
        return sorted(seed for part in self.parts for seed in part)


@dataclass(frozen=True)
class Block:
    """Rows of one origin: measured here, or the paper's."""

    title: str
    rows: tuple[Row, ...]
    ours: bool


@dataclass(frozen=True)
class Table:
    """``name`` is that of its files."""

    name: str
    title: str
    columns: tuple[str, ...]
    blocks: tuple[Block, ...]
    notes: tuple[str, ...] = ()
    signed: bool = False  # differences, which show + and -
    papers: frozenset[str] = frozenset()  # columns that hold the paper's own figures, beside ours
    words: dict[str, str] = field(default_factory=dict)  # by row: what is said before its figures

    def rows(self) -> Iterator[tuple[Block, Row]]:
        """All rows with their blocks."""
        return ((block, row) for block in self.blocks for row in block.rows)

    def said(self, block: Block, row: Row) -> list[str]:
        """A cell of words before a row's figures, empty for the paper's rows; no cell where the table has no words."""
        return [self.words.get(row.title, "") if block.ours else ""] if self.words else []


def percent(cell: Interval | None, signed: bool = False) -> str:
    """A figure in percent, without its interval."""
    if cell is None:
        return "-"
    return f"{100 * cell.value:{'+' if signed else ''}.1f}"


def between(cell: Interval | None, signed: bool = False) -> str:
    """An interval in percent, empty where there is none."""
    if cell is None or cell.low is None or cell.high is None:
        return ""
    sign = "+" if signed else ""
    return f"{100 * cell.low:{sign}.1f} to {100 * cell.high:{sign}.1f}"


def seeds(row: Row) -> str:
    """Seeds in words, and on how few trainings of stage 1 they stand."""
    few = len(row.parts)
    on = f" on {'one stage' if few == 1 else f'{few} stages'} 1" if few < len(row.seeds) else ""
    return ", ".join(map(str, row.seeds)) + on
