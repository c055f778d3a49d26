"""Figures of many resamples at once, formed of sums as ``most.metrics.panoptic`` forms them of a split's.

One difference: a class that the held-out sequences have, but a draw of them has not, is left out of the draw's means
instead of counting 0. Else a class that is in one sequence alone would let the figure jump by its share with every
draw. Classes that no sequence has count 0, as officially. A class of objects too small to count is there as soon as
one of the runs that are compared finds one of them, since a match counts however small it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from most.reports.sums import POINTS, SEGMENTS, Measured, Sums

COLUMNS = {name: index for index, name in enumerate(SEGMENTS + POINTS)}
TINY = 1e-15
FEWEST = 10  # objects that PQ is formed of in a bin
Figures = dict[str, Float64[np.ndarray, "draws"]]


@dataclass
class Presence:
    """Which classes each sequence has: segments that count, by the truth of any run, and points."""

    segments: Bool[np.ndarray, "sequences classes"]
    points: Bool[np.ndarray, "sequences classes"]

    @classmethod
    def of(cls, runs: Sequence[Sums]) -> "Presence":
        """Of all runs on these sequences together, so that it is the same for those that are compared."""
        counts = np.maximum.reduce([run.counts for run in runs])
        return cls(counts[:, COLUMNS["tp"]] + counts[:, COLUMNS["fn"]] > 0, counts[:, COLUMNS["true"]] > 0)


def figures(sums: Sums, presence: Presence, weights: Float64[np.ndarray, "draws sequences"]) -> Figures:
    """All figures of one run in each draw, fractions; ``distance/BIN``, ``points/BIN`` and ``visible/BIN`` among them.

    ``pq/CLASS`` is there for the classes that the held-out sequences have.
    """
    of_class = _of_classes(np.tensordot(weights, sums.counts, 1))
    there = {name: weights @ getattr(presence, name) > 0 for name in ("segments", "points")}
    ever = {name: getattr(presence, name).any(0) for name in there}
    found: Figures = {}
    for name, kind in {"pq": "segments", "sq": "segments", "rq": "segments", "miou": "points"}.items():
        for part, classes in _parts(sums.measured).items():
            values = of_class[name][:, classes]
            here, known = there[kind][:, classes], ever[kind][classes]
            found[name + part] = _mean(values, here | ~known)
            found[f"{name}{part}_present"] = _mean(values, here)
    found["pq_dagger"] = _dagger(of_class, there, ever, sums.measured)
    named = [(index, name) for index, name in enumerate(sums.measured.classes) if ever["segments"][index]]
    pq = np.where(there["segments"], of_class["pq"], np.nan)
    found |= {f"pq/{name}": pq[:, index] for index, name in named}
    tracking = _tracking(sums, weights, of_class, found["miou"])
    tracking |= _tracks(sums, weights, there["segments"], found["pq"])
    return found | _binned(sums, weights) | _memberships(sums, weights) | tracking


def _of_classes(totals: Float64[np.ndarray, "draws 7 classes"]) -> dict[str, Float64[np.ndarray, "draws classes"]]:
    """``pq sq rq miou union`` of each class; see ``class_figures`` there."""
    tp, fp, fn, iou, hits, predicted, true = (totals[:, index] for index in range(totals.shape[1]))
    sq, rq = iou / np.maximum(tp, TINY), tp / np.maximum(tp + fp / 2 + fn / 2, TINY)
    union = predicted + true - hits
    return {"pq": sq * rq, "sq": sq, "rq": rq, "miou": hits / np.maximum(union, TINY), "union": union}


def _parts(measured: Measured) -> dict[str, list[int]]:
    named = list(range(1, len(measured.classes)))
    stuff = [index for index in named if index not in measured.things]
    return {"": named, "_things": list(measured.things), "_stuff": stuff}


def _dagger(
    of_class: dict[str, Float64[np.ndarray, "draws classes"]],
    there: dict[str, Bool[np.ndarray, "draws classes"]],
    ever: dict[str, Bool[np.ndarray, "classes"]],
    measured: Measured,
) -> Float64[np.ndarray, "draws"]:
    """PQ of things and IoU of stuff."""
    things, stuff = list(measured.things), _parts(measured)["_stuff"]
    values = np.concatenate([of_class["pq"][:, things], of_class["miou"][:, stuff]], 1)
    counted = [(there[kind] | ~ever[kind])[:, of] for kind, of in (("segments", things), ("points", stuff))]
    return _mean(values, np.concatenate(counted, 1))


def _binned(sums: Sums, weights: Float64[np.ndarray, "draws sequences"]) -> Figures:
    """PQ of all things together in each bin that has some objects, NaN in draws without any."""
    found: Figures = {}
    for name in ("distance", "points", "visible"):
        if (counts := getattr(sums, name)) is None:
            continue
        tp, fp, fn, iou = np.moveaxis(np.tensordot(weights, counts, 1), 1, 0)
        with np.errstate(invalid="ignore"):
            pq = iou / (tp + fp / 2 + fn / 2)
        objects = counts[:, [SEGMENTS.index("tp"), SEGMENTS.index("fn")]].sum((0, 1))
        found |= {f"{name}/{index}": pq[:, index] for index in np.flatnonzero(objects >= FEWEST)}
    return found


def _memberships(sums: Sums, weights: Float64[np.ndarray, "draws sequences"]) -> Figures:
    if sums.membership is None:
        return {}
    right, total, contested, contested_total = (weights @ sums.membership).T
    with np.errstate(invalid="ignore"):
        return {"membership_accuracy": right / total, "membership_accuracy_contested": contested / contested_total}


def _tracking(
    sums: Sums,
    weights: Float64[np.ndarray, "draws sequences"],
    of_class: dict[str, Float64[np.ndarray, "draws classes"]],
    miou: Float64[np.ndarray, "draws"],
) -> Figures:
    """``lstq s_assoc s_cls``, of which SemanticKITTI's S_cls leaves out absent classes; see ``most.metrics.lstq``."""
    if sums.tracks is None:
        return {}
    association, tubes = np.moveaxis(np.tensordot(weights, sums.tracks, 1), 1, 0)
    s_cls = miou if sums.measured.evaluator == "nuscenes" else _mean(of_class["miou"], of_class["union"] > 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        s_assoc = association.sum(1) / tubes[:, list(sums.measured.things)].sum(1)
        return {"lstq": np.sqrt(s_assoc * s_cls), "s_assoc": s_assoc, "s_cls": s_cls}


def _tracks(
    sums: Sums,
    weights: Float64[np.ndarray, "draws sequences"],
    there: Bool[np.ndarray, "draws classes"],
    pq: Float64[np.ndarray, "draws"],
) -> Figures:
    """``ptq tq pat`` of nuScenes; see ``most.metrics.tracking_figures``."""
    if sums.switches is None or sums.tq is None:
        return {}
    tp, fp, fn, iou = np.moveaxis(np.tensordot(weights, sums.counts, 1), 1, 0)[: len(SEGMENTS)]
    of_class = (iou - weights @ sums.switches) / np.maximum(tp + fp / 2 + fn / 2, TINY)
    with np.errstate(invalid="ignore"):
        quality, tracks = (weights @ sums.tq).T
        tq = quality / tracks
        named = slice(1, None)
        return {"ptq": _mean(of_class[:, named], there[:, named]), "tq": tq, "pat": 2 * pq * tq / (pq + tq)}


def _mean(
    values: Float64[np.ndarray, "draws classes"], counted: Bool[np.ndarray, "draws classes"]
) -> Float64[np.ndarray, "draws"]:
    """The mean over the classes that count in each draw, NaN where none does."""
    with np.errstate(invalid="ignore"):
        return (values * counted).sum(1) / counted.sum(1)
