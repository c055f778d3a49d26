"""The paper's tables of a group of runs: Tables I to V and PQ by class; ours and the paper's figures are apart."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from most.metrics.paper_tables import MEANS, SEGMENTATION, TRACKING, class_order
from most.reports.ablations import Ablation
from most.reports.analysis import Analysis
from most.reports.bins import by_visible
from most.reports.notes import predictions, trackers, unseen, unsummed
from most.reports.paper import paper_block
from most.reports.sums import SEGMENTS
from most.reports.table import Block, Row, Table
from most.reports.units import BySeed, units


def measured_here(analysis: Analysis) -> str:
    """The title over our rows."""
    return f"Measured here: {analysis.group.title}"


def ablation_table(ablation: Ablation, analysis: Analysis) -> Table:
    """Table I or II."""
    return _table(
        analysis,
        ablation.name,
        ablation.title,
        _runs(ablation, analysis),
        ablation.columns,
        ablation.notes,
        paper=ablation.name,
    )


def difference_table(ablation: Ablation, analysis: Analysis, baseline: str | None) -> Table | None:
    """Differences of all rows to ``baseline``, if it is one of them; None where there is no other."""
    wanted = baseline if baseline in ablation.rows else ablation.first
    base = ablation.rows.get(wanted, next(iter(ablation.rows.values())))
    made = []
    for each in ablation.rows.values():
        if each != base:
            runs, others = ablation.pair(analysis.group, each, base)
            cells = analysis.differences(runs, others, ablation.columns)
            made.append(Row(ablation.title_of(each), cells, units(runs, others)))
    if not made:
        return None
    title = f"{ablation.title}, differences to {ablation.title_of(base)}"
    block = Block(measured_here(analysis), tuple(made), ours=True)
    notes = ("Percent points, over the seeds that both have, which are resampled together.",)
    return Table(f"{ablation.name}_differences", title, tuple(ablation.columns), (block,), notes, signed=True)


def occlusion_tables(ablation: Ablation, analysis: Analysis, baseline: str | None) -> list[Table]:
    """PQ of the rows of Table I by how much of an object is seen, and differences; none where no run knows it."""
    bins, rows = by_visible(), _runs(ablation, analysis)
    known = [run.sums.visible for runs in rows.values() for run in runs.values() if run.sums.visible is not None]
    if not known:
        return []
    objects = np.max([seen[:, [SEGMENTS.index("tp"), SEGMENTS.index("fn")]].sum((0, 1)) for seen in known], 0)
    shown = ", ".join(f"{count:g} of {label}" for label, count in zip(bins.labels, objects, strict=True))
    notes = (bins.meaning, f"Objects in all scans, at most: {shown}.", *unseen(rows))
    parted = replace(ablation, name="occlusion", title=f"{bins.title}, by the {bins.axis}", columns=bins.columns)
    whole = _table(analysis, parted.name, parted.title, rows, parted.columns, notes, paper=None)
    apart = difference_table(parted, analysis, baseline)
    return [whole, *([] if apart is None else [apart])]


def benchmark_tables(analysis: Analysis) -> list[Table]:
    """Table III (nuScenes) or IV (SemanticKITTI), Table V of tracked predictions, and PQ by class; all strategies."""
    group = analysis.group
    rows = {f"{each.title}, {each.membership}": group.by_seed(each) for each in group.strategies}
    evaluator = group.measured.evaluator
    name, title = ("table3", "Table III") if evaluator == "nuscenes" else ("table4", "Table IV")
    made = [_table(analysis, name, f"{title}: lidar panoptic segmentation", rows, SEGMENTATION, paper=name)]
    if tracked := {name: found for name, runs in rows.items() if (found := _tracked(runs))}:
        title, columns = "Table V: 4D lidar panoptic segmentation", TRACKING | {"PQ": "pq"}
        notes = (*trackers(tracked), *unsummed(tracked, evaluator))
        made.append(_table(analysis, "table5", title, tracked, columns, notes, paper=f"table5_{evaluator}"))
    classes = {name: f"pq/{name}" for name in class_order(dict.fromkeys(group.measured.classes[1:]))}
    paper = f"classes_{evaluator}"
    return [*made, _table(analysis, "classes", "PQ by class (supplement)", rows, classes | MEANS, paper=paper)]


def _tracked(runs: BySeed) -> BySeed:
    """The runs whose 4D figures are known."""
    return {seed: run for seed, run in runs.items() if run.sums.tracks is not None}


def _runs(ablation: Ablation, analysis: Analysis) -> dict[str, BySeed]:
    return {ablation.title_of(each): ablation.runs(analysis.group, each) for each in ablation.rows.values()}


def _table(
    analysis: Analysis,
    name: str,
    title: str,
    rows: Mapping[str, BySeed],
    columns: Mapping[str, str],
    notes: tuple[str, ...] = (),
    *,
    paper: str | None,
) -> Table:
    made = [Row(row, analysis.cells(runs, columns), units(runs)) for row, runs in rows.items()]
    blocks = [Block(measured_here(analysis), tuple(made), ours=True), *([paper_block(paper)] if paper else [])]
    return Table(name, title, tuple(columns), tuple(blocks), (*notes, *predictions(rows)))
