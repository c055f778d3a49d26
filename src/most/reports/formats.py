"""Tables as Markdown, LaTeX (booktabs) and CSV; ours and the paper's are told apart in each."""

import csv
import io
from collections.abc import Iterable

from most.reports.table import Block, Row, Table, between, percent, seeds

LATEX = str.maketrans(
    {"&": r"\&", "%": r"\%", "_": r"\_", "#": r"\#", "$": r"\$", "{": r"\{", "}": r"\}", "+": "{+}",
     "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
)  # fmt: skip


def markdown(table: Table) -> str:
    """A table with a line that parts ours from the paper's."""
    head = ["", *(["order"] if table.words else []), *table.columns, "seeds"]
    lines = [f"### {table.title}", "", _line(head), _line(["---"] * len(head))]
    for block in table.blocks:
        lines.append(_line([f"**{block.title}**", *[""] * (len(head) - 1)]))
        lines += [_line(_cells(table, block, row)) for row in block.rows]
    return "\n".join([*lines, "", *(f"*{note}*\n" for note in table.notes)])


def latex(table: Table, before: str = "") -> str:
    """A tabular for booktabs; ``before`` tells its label from those of other groups."""
    head = ["", *(["order"] if table.words else []), *table.columns, "seeds"]
    width = len(head)
    lines = [
        r"\begin{table*}", rf"\caption{{{_tex(table.title)}}}",
        rf"\label{{tab:{before}{table.name}}}", r"\centering\small",
        rf"\begin{{tabular}}{{l{'r' * (width - 1)}}}", r"\toprule", _tex_line(map(_tex, head)),
    ]  # fmt: skip
    for block in table.blocks:
        lines += [r"\midrule", rf"\multicolumn{{{width}}}{{l}}{{\textit{{{_tex(block.title)}}}}} \\"]
        lines += [_tex_line(_tex(cell) for cell in _cells(table, block, row)) for row in block.rows]
    notes = [rf"\par\smallskip\footnotesize {_tex(note)}" for note in table.notes]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", *notes, r"\end{table*}", ""])


def comma_separated(table: Table) -> str:
    """A row for each row: figures as fractions with their intervals, and whose they are.

    Ten digits: the last of sixteen depend on how many threads added up.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    figures = [name for column in table.columns for name in (column, f"{column} low", f"{column} high")]
    writer.writerow(["row", "from", "of", *(["order"] if table.words else []), "seeds", *figures])
    for block, row in table.rows():
        cells = [row.cells.get(column) for column in table.columns]
        parts = [part for cell in cells for part in ((cell.value, cell.low, cell.high) if cell else (None,) * 3)]
        values = ["" if part is None else f"{part:.10g}" for part in parts]
        whose = ["ours" if block.ours else "paper", block.title]
        writer.writerow([row.title, *whose, *table.said(block, row), " ".join(map(str, row.seeds)), *values])
    return text.getvalue()


def _cells(table: Table, block: Block, row: Row) -> list[str]:
    """A row's texts: title, what is said, figures with intervals, seeds."""
    texts = []
    for column in table.columns:
        cell = row.cells.get(column)
        interval = between(cell, table.signed)
        texts.append(percent(cell, table.signed) + (f" ({interval})" if interval else ""))
    return [row.title, *table.said(block, row), *texts, seeds(row)]


def _line(cells: list[str]) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _tex(text: str) -> str:
    return text.translate(LATEX)


def _tex_line(cells: Iterable[str]) -> str:
    return " & ".join(cells) + r" \\"
