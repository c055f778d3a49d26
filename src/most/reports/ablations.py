"""Which strategies of a group make the rows of Tables I and II."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from most.reports.groups import Group
from most.reports.strategy import Strategy
from most.reports.units import BySeed

AMODALIZATION = {
    "PQ": "pq", "PQ Th": "pq_things", "PQ St": "pq_stuff",
    "mIoU": "miou", "mIoU Th": "miou_things", "mIoU St": "miou_stuff", "PQ present": "pq_present",
}  # fmt: skip
MEMBERSHIP = {
    "PQ": "pq", "mIoU": "miou", "Membership Acc": "membership_accuracy", "contested": "membership_accuracy_contested",
    "PQ present": "pq_present",
}  # fmt: skip
PRESENT = (
    "PQ present: the mean over the classes that the held-out sequences have; official means count absent ones as 0."
)
CONTESTED = "contested: membership accuracy of the points that lie in the regions of several objects alone."
OWN_REGIONS = "Clusterings make regions of their own: their membership accuracy would be one over other points."
SMALL = "DSB drops instances of few points here (extent.min_points), whatever their size; the paper drops small boxes."


@dataclass(frozen=True)
class Ablation:
    """One part of the method exchanged, all else held."""

    name: str  # of the paper's table
    title: str
    rows: dict[str, Strategy]  # by the name that baseline=... has
    columns: dict[str, str]
    notes: tuple[str, ...]
    first: str  # what differences are against unless another is chosen
    beside: bool  # rows are memberships, and nearest centres those of the runs that trained stage 2

    def title_of(self, strategy: Strategy) -> str:
        """A row's title."""
        return strategy.membership_title if self.beside else strategy.title

    def runs(self, group: Group, strategy: Strategy, like: BySeed | None = None) -> BySeed:
        """A row's runs; where there are several of a seed, those on the stage 1 of ``like``."""
        return group.by_seed(strategy, self.beside, like)

    def pair(self, group: Group, strategy: Strategy, other: Strategy) -> tuple[BySeed, BySeed]:
        """Two rows' runs, on the same stages 1 where there are such."""
        others = self.runs(group, other, self.runs(group, strategy))
        return self.runs(group, strategy, others), others


def amodalization(group: Group) -> Ablation:
    """Table I: with the membership that most strategies were scored with, the fullest of several.

    Offsets have no detected centres, so theirs is their own, the one that most trainings were scored with.
    """
    by_membership = _by(group.strategies, lambda each: each.membership if each.has_centres else "")
    offsets = _by(by_membership.pop("", []), lambda each: each.detection).values()
    fullest = [max(ways, key=lambda each: len(group.by_seed(each))) for ways in offsets]
    widest = max(by_membership.values(), key=lambda rows: (len(rows), rows[0].order[-2:]), default=[])
    rows = {each.detection: each for each in [*fullest, *widest]}
    ways = dict.fromkeys(each.membership_title for each in rows.values())
    notes = (f"Membership here: {'; '.join(ways)}.", *_settings(group), PRESENT)
    notes += (SMALL,) if any(each.extent.startswith("drop_small") for each in rows.values()) else ()
    title = "Table I: strategies for amodalization"
    return Ablation("table1", title, rows, AMODALIZATION, notes, "shrink_wrap", beside=False)


def memberships(group: Group) -> Ablation:
    """Table II: on the stage 1 that most memberships were tried on, of several the paper's: SW."""
    found = max(
        _by(group.strategies, lambda each: each.detection).values(),
        key=lambda rows: (len(rows), rows[0].detection == "shrink_wrap"),
    )
    notes = (f"Stage 1 here: {found[0].title}.", *_settings(group), CONTESTED, PRESENT)
    notes += () if all(each.has_regions for each in found) else (OWN_REGIONS,)
    rows = {each.membership: each for each in found}
    return Ablation("table2", "Table II: membership functions", rows, MEMBERSHIP, notes, "nearest", beside=True)


def _settings(group: Group) -> list[str]:
    """Say which settings all runs of a strategy have that are not its own."""
    return [f"Settings here: {'; '.join(group.settings)}."] if group.settings else []


def _by(strategies: Sequence[Strategy], key: Callable[[Strategy], str]) -> dict[str, list[Strategy]]:
    found: dict[str, list[Strategy]] = {}
    for each in strategies:
        found.setdefault(key(each), []).append(each)
    return found
