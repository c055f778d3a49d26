"""One self-contained HTML page: tables and plots of all groups, and the runs that could not be counted."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from string import Template

from most.reports.plots import INK, Plot
from most.reports.table import Block, Row, Table, between, percent, seeds

IDS = re.compile(r'(\bid="|url\(#|href="#)')


@dataclass(frozen=True)
class Chapter:
    """What one group of runs has to say: what was exchanged, in tables and plots, then the benchmarks' tables."""

    title: str
    remarks: Sequence[str]  # on all of it
    ablations: Sequence[Table]
    plots: Sequence[Plot]
    benchmarks: Sequence[Table]

    @property
    def tables(self) -> list[Table]:
        """All of them."""
        return [*self.ablations, *self.benchmarks]


def page(title: str, summary: str, chapters: Sequence[Chapter], left_out: Mapping[str, str]) -> str:
    """Return the page."""
    template = Template((Path(__file__).parent / "page.html").read_text())
    body = [_chapter(f"group{number}", chapter) for number, chapter in enumerate(chapters, start=1)]
    links = {f"group{number}": chapter.title for number, chapter in enumerate(chapters, start=1)}
    if left_out:
        body.append(_left_out(left_out))
        links["left-out"] = f"Left out ({len(left_out)})"
    contents = "".join(f'<li><a href="#{key}">{escape(text)}</a></li>' for key, text in links.items())
    return template.substitute(title=escape(title), summary=escape(summary), contents=contents, body="\n".join(body))


def _chapter(key: str, chapter: Chapter) -> str:
    parts = [f"<p>{escape(remark)}</p>" for remark in chapter.remarks]
    parts += [_table(f"{key}-{table.name}", table) for table in chapter.ablations]
    parts += [_figure(f"{key}-{plot.name}", plot) for plot in chapter.plots]
    parts += [_table(f"{key}-{table.name}", table) for table in chapter.benchmarks]
    return f'<section id="{key}" aria-labelledby="{key}-title"><h2 id="{key}-title">{escape(chapter.title)}</h2>\n' + (
        "\n".join(parts) + "\n</section>"
    )


def _table(key: str, table: Table) -> str:
    words = ['<th scope="col" class="words">order</th>'] if table.words else []
    columns = [f'<th scope="col">{escape(column)}</th>' for column in table.columns]
    head = "".join(['<th scope="col">row</th>', *words, *columns, '<th scope="col">seeds</th>'])
    body = "\n".join(_block(table, block, len(columns) + len(words) + 2) for block in table.blocks)
    notes = "".join(f'<p class="note">{escape(note)}</p>' for note in table.notes)
    title = escape(table.title)
    return (
        f'<div class="card" id="{key}"><div class="scroll" role="region" tabindex="0" aria-label="{title}">'
        f"<table><caption>{title}</caption><thead><tr>{head}</tr></thead>\n{body}</table></div>{notes}</div>"
    )


def _block(table: Table, block: Block, width: int) -> str:
    whose = f'<tr class="whose"><th scope="rowgroup" colspan="{width}">{escape(block.title)}</th></tr>'
    rows = "\n".join(_row(table, block, row) for row in block.rows)
    return f'<tbody class="{"ours" if block.ours else "paper"}">{whose}\n{rows}</tbody>'


def _row(table: Table, block: Block, row: Row) -> str:
    cells = [f'<th scope="row">{escape(row.title)}</th>']
    cells += [f'<td class="words">{escape(text)}</td>' for text in table.said(block, row)]
    for column in table.columns:
        figure = row.cells.get(column)
        interval = between(figure, table.signed)
        small = f"<small>{escape(interval)}</small>" if interval else ""
        whose = ' class="paper"' if column in table.papers else ""
        cells.append(f"<td{whose}>{escape(percent(figure, table.signed))}{small}</td>")
    return f"<tr>{''.join(cells)}<td>{escape(seeds(row))}</td></tr>"


def _figure(key: str, plot: Plot) -> str:
    """A plot in the colours of the page; its ids are its own."""
    svg = IDS.sub(rf"\g<1>{key}-", plot.svg).replace(INK, "currentColor")
    svg = svg.replace("<svg ", f'<svg role="img" aria-label="{escape(plot.title)}" ', 1)
    title, meaning = escape(plot.title), escape(plot.meaning)
    return f'<figure class="card" id="{key}"><h3>{title}</h3>{svg}<figcaption>{meaning}</figcaption></figure>'


def _left_out(left_out: Mapping[str, str]) -> str:
    rows = "".join(f"<tr><th scope='row'>{escape(path)}</th><td class='words'>{escape(why)}</td></tr>"
                   for path, why in left_out.items())  # fmt: skip
    return (
        '<section id="left-out"><h2>Left out</h2>'
        '<div class="card scroll" role="region" tabindex="0" aria-label="Left out">'
        "<table><caption>Runs that are not counted</caption><thead><tr><th scope='col'>run</th>"
        f"<th scope='col' class='words'>why</th></tr></thead><tbody>{rows}</tbody></table></div></section>"
    )
