"""Where a prediction and the truth of a scan disagree, and which of their instances are the same."""

from dataclasses import dataclass
from enum import IntEnum

import torch
from jaxtyping import Int64
from torch import Tensor

from most.structures import Panoptic

SAME = 0.5  # intersection over union above which two segments are one instance, as in the panoptic quality


class Verdict(IntEnum):
    """What is to be said of one point."""

    RIGHT = 0
    WRONG_CLASS = 1
    WRONG_INSTANCE = 2  # of the right class
    NOT_SCORED = 3  # the truth is void


@dataclass
class Agreement:
    """The comparison of two panoptic labellings of the same points."""

    verdicts: Int64[Tensor, "points"]
    partners: dict[int, int]  # segment of the prediction -> segment of the truth that is the same instance


def segments(labels: Panoptic, things: list[int]) -> Int64[Tensor, "points"]:
    """Return a number for each (class, instance), 0 for points without an instance; ids may be raw labels."""
    is_thing = torch.isin(labels.semantics, torch.tensor(things, device=labels.semantics.device))
    return torch.where(is_thing & (labels.ids > 0), (labels.semantics << 32) + labels.ids, 0)


def compare(truth: Panoptic, prediction: Panoptic, things: list[int]) -> Agreement:
    """Compare two labellings; void points of the truth count for nothing."""
    scored = truth.semantics != 0
    ours, theirs = segments(prediction, things), segments(truth, things)
    partners = _partners(ours[scored], theirs[scored])
    matched = torch.tensor([[mine, yours] for mine, yours in partners.items()], dtype=torch.int64).reshape(-1, 2)
    partner = _look_up(theirs, matched[:, 1], matched[:, 0])
    verdicts = torch.full_like(ours, Verdict.RIGHT)
    verdicts[(theirs > 0) & (ours != partner)] = Verdict.WRONG_INSTANCE
    verdicts[truth.semantics != prediction.semantics] = Verdict.WRONG_CLASS
    verdicts[~scored] = Verdict.NOT_SCORED
    return Agreement(verdicts, partners)


def _partners(ours: Int64[Tensor, "points"], theirs: Int64[Tensor, "points"]) -> dict[int, int]:
    """Return which segments of the same class overlap by more than ``SAME``; no segment has two such partners."""
    size, their_size = _sizes(ours), _sizes(theirs)
    both = (ours > 0) & (ours >> 32 == theirs >> 32)
    names, rows = torch.unique(ours[both], return_inverse=True)
    their_names, columns = torch.unique(theirs[both], return_inverse=True)
    overlaps = torch.bincount(rows * len(their_names) + columns, minlength=len(names) * len(their_names))
    table = overlaps.view(len(names), len(their_names)).tolist()
    return {
        mine: yours
        for mine, row in zip(names.tolist(), table, strict=True)
        for yours, overlap in zip(their_names.tolist(), row, strict=True)
        if overlap > SAME * (size[mine] + their_size[yours] - overlap)
    }


def _sizes(keys: Int64[Tensor, "points"]) -> dict[int, int]:
    names, counts = torch.unique(keys, return_counts=True)
    return dict(zip(names.tolist(), counts.tolist(), strict=True))


def _look_up(keys: Int64[Tensor, "points"], known: Int64[Tensor, "known"], values: Tensor) -> Int64[Tensor, "points"]:
    """Return the value of each key, -1 where it is not known."""
    if not len(known):
        return torch.full_like(keys, -1)
    order = torch.argsort(known)
    at = torch.searchsorted(known[order], keys).clamp(max=len(known) - 1)
    return torch.where(known[order][at] == keys, values[order][at], -1)
