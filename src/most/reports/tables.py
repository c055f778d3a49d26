"""The paper's tables of a group of runs: Tables I to V and PQ by class; ours and the paper's figures are apart."""

from collections.abc import Mapping

from most.metrics.paper_tables import MEANS, SEGMENTATION, TRACKING, class_order
from most.reports.ablations import Ablation
from most.reports.analysis import Analysis, BySeed
from most.reports.paper import paper_block
from most.reports.table import Block, Row, Table


def measured_here(analysis: Analysis) -> str:
    """The title over our rows."""
    return f"Measured here: {analysis.group.title}"


def ablation_table(ablation: Ablation, analysis: Analysis) -> Table:
    """Table I or II."""
    rows = {ablation.title_of(each): ablation.runs(analysis.group, each) for each in ablation.rows.values()}
    return _table(analysis, ablation.name, ablation.title, rows, ablation.columns, ablation.notes)


def difference_table(ablation: Ablation, analysis: Analysis, baseline: str | None) -> Table | None:
    """Differences of all rows of Table I or II to ``baseline``, if it is one of them; None where there is no other."""
    wanted = baseline if baseline in ablation.rows else ablation.first
    base = ablation.rows.get(wanted, next(iter(ablation.rows.values())))
    others = ablation.runs(analysis.group, base)
    made = []
    for each in ablation.rows.values():
        runs = ablation.runs(analysis.group, each)
        if each != base:
            seeds = tuple(sorted(runs.keys() & others.keys()))
            made.append(Row(ablation.title_of(each), analysis.differences(runs, others, ablation.columns), seeds))
    if not made:
        return None
    title = f"{ablation.title}, differences to {ablation.title_of(base)}"
    block = Block(measured_here(analysis), tuple(made), ours=True)
    notes = ("Percent points, over the seeds that both have, which are resampled together.",)
    return Table(f"{ablation.name}_differences", title, tuple(ablation.columns), (block,), notes, signed=True)


def benchmark_tables(analysis: Analysis) -> list[Table]:
    """Table III (nuScenes) or IV (SemanticKITTI), Table V of tracked predictions, and PQ by class; all strategies."""
    group = analysis.group
    rows = {f"{each.title}, {each.membership}": group.by_seed(each) for each in group.strategies}
    evaluator = group.measured.evaluator
    name, title = ("table3", "Table III") if evaluator == "nuscenes" else ("table4", "Table IV")
    made = [_table(analysis, name, f"{title}: lidar panoptic segmentation", rows, SEGMENTATION)]
    tracked = {name: runs for name, runs in rows.items() if all(each.sums.tracks is not None for each in runs.values())}
    if tracked:
        title, columns = "Table V: 4D lidar panoptic segmentation", TRACKING | {"PQ": "pq"}
        made.append(_table(analysis, "table5", title, tracked, columns, paper=f"table5_{evaluator}"))
    classes = {name: f"pq/{name}" for name in class_order(dict.fromkeys(group.measured.classes[1:]))}
    paper = f"classes_{evaluator}"
    return [*made, _table(analysis, "classes", "PQ by class (supplement)", rows, classes | MEANS, paper=paper)]


def _table(
    analysis: Analysis,
    name: str,
    title: str,
    rows: Mapping[str, BySeed],
    columns: Mapping[str, str],
    notes: tuple[str, ...] = (),
    paper: str | None = None,
) -> Table:
    made = (Row(row, analysis.cells(runs, columns), tuple(sorted(runs))) for row, runs in rows.items())
    ours = Block(measured_here(analysis), tuple(made), ours=True)
    return Table(name, title, tuple(columns), (ours, paper_block(paper or name)), notes)
