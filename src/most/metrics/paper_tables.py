"""The paper's tables as rows of a report's figures, whoever lays them out, and why a figure is none.

A report is what ``most.evaluate`` writes, fresh or read back from its JSON.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

SEGMENTATION = {  # Tables III and IV
    "PQ": "pq", "PQ dagger": "pq_dagger", "RQ": "rq", "SQ": "sq",
    "PQ Th": "pq_things", "RQ Th": "rq_things", "SQ Th": "sq_things",
    "PQ St": "pq_stuff", "RQ St": "rq_stuff", "SQ St": "sq_stuff",
    "mIoU": "miou",
}  # fmt: skip
TRACKING = {"LSTQ": "lstq", "PAT": "pat", "S_assoc": "s_assoc", "S_cls": "s_cls", "PTQ": "ptq"}  # Table V
BESIDE = {  # what the nuScenes evaluator prints besides
    "TQ": "tq", "sPTQ": "sptq", "PTQ dagger": "ptq_dagger", "MOTSA": "motsa", "sMOTSA": "smotsa", "MOTSP": "motsp",
}  # fmt: skip
MEANS = {"PQ Th": "pq_things", "PQ St": "pq_stuff", "PQ": "pq"}  # at the end of a class-wise row
SEMANTICKITTI = (  # the columns of the supplement's Table II; those of its Table I are in the order of the class ids
    *("car", "truck", "bicycle", "motorcycle", "other-vehicle", "person", "bicyclist", "motorcyclist"),
    *("road", "sidewalk", "parking", "other-ground", "building", "vegetation", "trunk", "terrain", "fence", "pole"),
    "traffic-sign",
)
NO_TRACK = "no thing of the truth has enough points in any scan to be followed"
REASONS = {  # why a figure is not a number
    "s_assoc": NO_TRACK,
    "tq": NO_TRACK,
    "s_cls": "no point has a known class",
    "ptq": "the truth has no segment that counts",
    "sptq": "the truth has no segment that counts",
    "motsa": "the truth has no thing that counts",
    "smotsa": "the truth has no thing that counts",
    "motsp": "the truth has no thing that counts",
    "pat": "PQ and TQ are both 0",
}
MADE_OF = {"lstq": ("s_assoc", "s_cls"), "pat": ("tq",)}  # figures that are none where one of these is


@dataclass(frozen=True)
class PaperRow:
    """One row of a table."""

    title: str
    figures: dict[str, float | None]  # fractions by column; None is what the dataset has not, or what is no number


def paper_rows(report: Mapping[str, Any]) -> list[PaperRow]:
    """Rows of Tables III or IV, of Table V, and of the supplement's class-wise PQ, in the paper's columns.

    The PQ of Table V is that of Tables III and IV. Figures of a class that never occurs are 0, as in the means.
    """
    panoptic, sequences = report["panoptic"], _sequences(report)
    classes = {name: panoptic["per_class"][name]["pq"] for name in class_order(panoptic["per_class"])}
    rows = [
        PaperRow("panoptic segmentation (Tables III, IV)", _select(panoptic, SEGMENTATION)),
        PaperRow("4D panoptic segmentation (Table V)", _select(sequences, TRACKING) | {"PQ": _number(panoptic["pq"])}),
        PaperRow("PQ by class (supplement)", classes | _select(panoptic, MEANS)),
    ]
    if "tracking" in report:
        rows.insert(2, PaperRow("tracking, besides", _select(sequences, BESIDE)))
    return rows


def class_order(names: Mapping[str, Any]) -> list[str]:
    """Names of classes in the paper's order."""
    return list(SEMANTICKITTI if set(names) == set(SEMANTICKITTI) else names)


def why_none(report: Mapping[str, Any]) -> Iterator[str]:
    """Say of 4D figures that are not numbers why they are none: a line for each reason."""
    sequences = _sequences(report)
    titles: dict[str, list[str]] = {}
    for title, key in (TRACKING | BESIDE).items():
        if key in sequences and _number(sequences[key]) is None:
            cause = next((part for part in MADE_OF.get(key, ()) if _number(sequences[part]) is None), key)
            titles.setdefault(REASONS[cause], []).append(title)
    for reason, of in titles.items():
        yield f"{', '.join(of)}: none, since {reason}"


def _sequences(report: Mapping[str, Any]) -> Mapping[str, Any]:
    """The section of 4D figures, of whichever evaluator; empty where a report has none, as those of training."""
    found: Mapping[str, Any] = report.get("tracking") or report.get("lstq") or {}
    return found


def _select(figures: Mapping[str, Any], columns: Mapping[str, str]) -> dict[str, float | None]:
    return {title: _number(figures.get(key)) for title, key in columns.items()}


def _number(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
