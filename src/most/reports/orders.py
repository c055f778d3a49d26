"""Does the paper's order of strategies show, and how surely?"""

from collections.abc import Mapping
from dataclasses import dataclass

from most.metrics.bootstrap import Interval
from most.reports.ablations import Ablation
from most.reports.analysis import Analysis
from most.reports.paper import paper_figure
from most.reports.strategy import EXTENTS
from most.reports.table import Block, Cells, Row, Table
from most.reports.tables import measured_here
from most.reports.units import units

SW, NEAREST = "shrink_wrap", "nearest"
WORDS = ("shown", "reversed", "open")


@dataclass(frozen=True)
class Claim:
    """The paper says that one row has the higher PQ."""

    worse: str
    better: str
    table: str
    paper_worse: str
    paper_better: str


_DETECTION = {
    "offset_regression": "Offset reg. (DS-Net)", f"{SW}+separate": "Modal Det. (SW), w/o sharing",
    SW: "Modal Det. (SW), w/ sharing", "drop_small": "Modal Det. (DSB)", "class_mean": "Modal Det. (CWM)",
    "track_max": "Modal Det. (MAX)", "amodal": "Amodal Det.",
}  # fmt: skip
_MEMBERSHIP = {
    NEAREST: "Nearest Neighbor (baseline)", "geometric": "Ours (semantic + geometric)",
    "geometric_bev": "+ BEV feat.", "full": "+ Point feat.",
}  # fmt: skip
_PAIRS = [
    ("offset_regression", f"{SW}+separate"), (f"{SW}+separate", SW), ("drop_small", SW), (SW, "class_mean"),
    ("drop_small", "class_mean"), ("class_mean", "track_max"), (SW, "track_max"), ("track_max", "amodal"),
]  # fmt: skip
_MEMBERSHIP_PAIRS = [(NEAREST, "geometric"), ("geometric_bev", "geometric"), ("geometric", "full"), (NEAREST, "full")]
CLAIMS = [
    *(Claim(worse, better, "table1", _DETECTION[worse], _DETECTION[better]) for worse, better in _PAIRS),
    *(Claim(worse, better, "table2", _MEMBERSHIP[worse], _MEMBERSHIP[better]) for worse, better in _MEMBERSHIP_PAIRS),
]
NAMES = EXTENTS | {"offset_regression": "offset regression", f"{SW}+separate": "SW w/o sharing"}
COLUMNS = {"PQ": "pq", "PQ Th": "pq_things", "Membership Acc": "membership_accuracy"}
PAPERS = {f"paper: {column}": column for column in COLUMNS}
NOTE = (
    "Differences, percent points. The order of PQ shows where the interval lies above 0, is reversed where it lies "
    "below, and is open in between; beside it, how many of all draws agree with the paper. Each row is told by itself: "
    "of twenty rows without any difference, one would be called shown or reversed. Of one training no order can be "
    "told; its interval is of other sequences with the same weights. Extents are made for things (PQ Th). Behind ours "
    "are the paper's own, on Panoptic nuScenes, validation."
)


def order_table(ablations: Mapping[str, Ablation], analysis: Analysis) -> Table | None:
    """Differences, ours and the paper's; None where no two such rows were run. Ablations are by table."""
    rows, said = [], {}
    for claim in CLAIMS:
        ablation = ablations[claim.table]
        if not {claim.worse, claim.better} <= ablation.rows.keys():
            continue
        title = " above ".join(NAMES.get(name, name) for name in (claim.better, claim.worse))
        better, worse = ablation.pair(analysis.group, ablation.rows[claim.better], ablation.rows[claim.worse])
        differences = analysis.differences(better, worse, COLUMNS)
        rows.append(Row(title, differences | _papers(claim), units(better, worse)))
        said[title] = verdict(differences["PQ"], len(rows[-1].parts))
    if not rows:
        return None
    block = Block(measured_here(analysis), tuple(rows), ours=True)
    shown = ", ".join(f"{sum(text.startswith(word) for text in said.values())} {word}" for word in WORDS)
    untold = sum(not text.startswith(WORDS) for text in said.values())
    title = f"Does the paper's order show? Of {len(rows)}: {shown}" + (f", {untold} not told" if untold else "")
    return Table(
        "orders", title, (*COLUMNS, *PAPERS), (block,), (NOTE,), signed=True, words=said, papers=frozenset(PAPERS)
    )


def _papers(claim: Claim) -> Cells:
    found: Cells = {}
    for title, column in PAPERS.items():
        high, low = (paper_figure(claim.table, name, column) for name in (claim.paper_better, claim.paper_worse))
        found[title] = None if high is None or low is None else Interval(high - low)
    return found


def verdict(difference: Interval | None, trainings: int) -> str:
    """Say how surely a difference, of as many pairs of trainings, is above 0."""
    if difference is None:
        return "no seed, or no stage 1, in common"
    if difference.low is None or difference.high is None or difference.above is None:
        return "no interval: one training, one sequence"
    agree = f"({100 * difference.above:.1f} % of draws agree)"
    if trainings == 1:
        return f"one training {agree}"
    return f"{WORDS[0 if difference.low > 0 else 1 if difference.high < 0 else 2]} {agree}"
