"""All files of a report on a folder of runs."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from most.errors import ConfigError
from most.files import atomic_write
from most.reports.ablations import Ablation, amodalization, memberships
from most.reports.analysis import Analysis
from most.reports.formats import comma_separated, latex, markdown
from most.reports.groups import Group, group
from most.reports.notes import remarks
from most.reports.orders import order_table
from most.reports.page import Chapter, page
from most.reports.plots import INK, plots
from most.reports.runs import Runs, find_runs
from most.reports.tables import ablation_table, benchmark_tables, difference_table, occlusion_tables

METHOD = (
    "Means over seeds in percent; below them 95 % intervals, of draws of seeds first and held-out sequences then, the "
    "same draws for all rows, spread as far as so few seeds and sequences ask for. What is said to be the paper's "
    "(italic, on tinted ground) was measured on other data: it is there to compare orders, not figures."
)


def write_reports(runs: Path, out: Path, baseline: str | None, draws: int, seed: int) -> list[Path]:
    """Read the runs and write ``report.html``, ``report.md``, ``report.tex``, ``tables/*.csv`` and ``plots/*.svg``.

    Raises DataError for runs that cannot be read, and ConfigError for a ``baseline`` that is no row.
    """
    found = find_runs(runs)
    chapters = _chapters(group(found.scored), baseline, draws, seed)
    left_out = {_relative(path, runs): why for path, why in found.left_out.items()}
    files = _files(chapters, left_out, _summary(found))
    for name, text in files.items():
        with atomic_write(out / name, "w") as file:
            file.write(text)
    return [out / name for name in files]


def _chapters(groups: Sequence[Group], baseline: str | None, draws: int, seed: int) -> list[Chapter]:
    ablations = [{"table1": amodalization(each), "table2": memberships(each)} for each in groups]
    _check_baseline(baseline, ablations)
    chapters = []
    for each, parts in zip(groups, ablations, strict=True):
        analysis = Analysis(each, draws, seed)
        tables = [order_table(parts, analysis)]
        for part in parts.values():
            tables += [ablation_table(part, analysis), difference_table(part, analysis, baseline)]
        tables += occlusion_tables(parts["table1"], analysis, baseline)
        known = [table for table in tables if table is not None]
        drawn, benchmarks = plots(parts, analysis), benchmark_tables(analysis)
        chapters.append(Chapter(each.title, [*remarks(each)], known, drawn, benchmarks))
    return chapters


def _check_baseline(baseline: str | None, ablations: Sequence[Mapping[str, Ablation]]) -> None:
    known = dict.fromkeys(name for parts in ablations for part in parts.values() for name in part.rows)
    if baseline is not None and baseline not in known:
        raise ConfigError(f"baseline: expected one of {', '.join(known)}, found {baseline}")


def _files(chapters: Sequence[Chapter], left_out: Mapping[str, str], summary: str) -> dict[str, str]:
    """Contents by name; of several groups, the second and later ones have a number before theirs."""
    title = "MOST: ablations and benchmarks"
    files = {"report.html": page(title, f"{summary} {METHOD}", chapters, left_out)}
    text, tex = [f"# {title}\n\n{summary} {METHOD}\n"], []
    for number, chapter in enumerate(chapters, start=1):
        before = "" if number == 1 else f"{number}_"
        text += [f"## {chapter.title}\n", *(f"{remark}\n" for remark in chapter.remarks)]
        text += map(markdown, chapter.ablations)
        text += [f"![{plot.title}](plots/{before}{plot.name}.svg)\n\n{plot.meaning}\n" for plot in chapter.plots]
        text += map(markdown, chapter.benchmarks)
        tex += [
            *(f"% {line}" for line in (chapter.title, *chapter.remarks)),
            *(latex(table, before) for table in chapter.tables),
        ]
        files |= {f"tables/{before}{table.name}.csv": comma_separated(table) for table in chapter.tables}
        files |= {f"plots/{before}{plot.name}.svg": plot.svg.replace(INK, "#222") for plot in chapter.plots}
    if left_out:
        text += ["## Left out\n", *(f"- `{path}`: {why}" for path, why in left_out.items()), ""]
    return files | {"report.md": "\n".join(text), "report.tex": "\n".join(tex)}


def _summary(runs: Runs) -> str:
    folders = {each.folder for each in runs.scored}
    left = f", {len(runs.left_out)} left out" if runs.left_out else ""
    return f"{len(folders)} finished run{'' if len(folders) == 1 else 's'}{left}."


def _relative(path: Path, folder: Path) -> str:
    return str(path.relative_to(folder)) if path != folder else "."
