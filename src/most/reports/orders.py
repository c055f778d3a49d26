"""Does the paper's order of strategies show, and how surely?"""

from collections.abc import Mapping
from dataclasses import dataclass

from most.reports.ablations import Ablation
from most.reports.analysis import Analysis
from most.reports.bootstrap import Interval
from most.reports.paper import paper_figure
from most.reports.table import Block, Row, Table
from most.reports.tables import measured_here

SW, NEAREST = "shrink_wrap", "nearest"


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
NOTE = (
    "Differences in PQ, percent points. The order shows where the interval lies above 0, is reversed where it lies "
    "below, and is open in between; beside it, in how many of all draws the first has the higher PQ."
)


def order_table(ablations: Mapping[str, Ablation], analysis: Analysis) -> Table | None:
    """Differences in PQ, ours and the paper's; None where no two such rows were run. Ablations are by table."""
    ours, papers, words = [], [], {}
    for claim in CLAIMS:
        ablation = ablations[claim.table]
        if not {claim.worse, claim.better} <= ablation.rows.keys():
            continue
        title = f"{claim.better} above {claim.worse}"
        better, worse = (ablation.runs(analysis.group, ablation.rows[name]) for name in (claim.better, claim.worse))
        difference = analysis.differences(better, worse, {"PQ": "pq"})["PQ"]
        ours.append(Row(title, {"PQ": difference}, tuple(sorted(better.keys() & worse.keys()))))
        words[title] = verdict(difference)
        high, low = (paper_figure(claim.table, name, "PQ") for name in (claim.paper_better, claim.paper_worse))
        papers.append(Row(title, {"PQ": Interval(high - low)}))
    if not ours:
        return None
    blocks = (
        Block(measured_here(analysis), tuple(ours), ours=True),
        Block("The paper's own figures: Panoptic nuScenes, validation", tuple(papers), ours=False),
    )
    return Table("orders", "Does the paper's order show?", ("PQ",), blocks, (NOTE,), signed=True, words=words)


def verdict(difference: Interval | None) -> str:
    """Say how surely a difference is above 0."""
    if difference is None:
        return "no seed in common"
    if difference.low is None or difference.high is None or difference.above is None:
        return "one run each: no interval"
    said = "shows" if difference.low > 0 else "is reversed" if difference.high < 0 else "is open"
    return f"{said} (in {100 * difference.above:.1f} % of draws)"
