"""What tells the rows of Tables I and II apart, read from a run's configuration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

EXTENTS = {"shrink_wrap": "SW", "drop_small": "DSB", "class_mean": "CWM", "track_max": "MAX", "amodal": "amodal"}
MEMBERSHIPS = {
    "nearest": "Nearest neighbour (baseline)",
    "clustering": "Clustering (training-free)",
    "mean_shift": "Mean shift",
    "geometric": "PointSegMLP (semantic + geometric)",
    "geometric_bev": "+ BEV feat.",
    "full": "+ Point feat. (full)",
}
CLUSTERINGS = ("clustering", "mean_shift")  # make regions of their own
UNTRAINED = ("nearest", *CLUSTERINGS)
AXES = ("extent", "heads", "membership")  # groups of the configuration that a table's rows differ in
PAPER = "modal_centres"


@dataclass(frozen=True)
class Strategy:
    """A way to train and to group points; each part is named as on the command line, changed settings behind it."""

    extent: str
    heads: str
    separate: bool
    membership: str

    @property
    def has_centres(self) -> bool:
        """Whether modal centres are detected, as the paper does."""
        return _parted(self.heads)[0] == PAPER

    @property
    def has_regions(self) -> bool:
        """Whether points are given to the regions of detected centres, over which the membership accuracy is taken."""
        return _parted(self.membership)[0] not in CLUSTERINGS

    @property
    def detection(self) -> str:
        """What Table I tells apart: all but the membership."""
        first = (
            self.extent + _parted(self.heads)[1] if self.has_centres else "+".join((self.heads, *self.extent.split()))
        )
        return first + ("+separate" if self.separate else "")

    @property
    def title(self) -> str:
        """The row's title in Table I."""
        extent, changed = _parted(self.extent)
        heads, changed_heads = _parted(self.heads)
        apart = (", w/o sharing" if self.separate else "") + changed_heads
        if not self.has_centres:
            middles = ", to the boxes' middles" if extent == "amodal" else ""
            return ("Offset reg. (DS-Net)" if heads == "offset_regression" else heads) + middles + apart
        if extent == "amodal":
            return f"Amodal Det.{changed}{apart}"
        if extent == "shrink_wrap" and not self.separate:  # told apart in the paper
            apart = f", w/ sharing{apart}"
        return f"Modal Det. ({EXTENTS.get(extent, extent)}){changed}{apart}"

    @property
    def membership_title(self) -> str:
        """The row's title in Table II."""
        base, changed = _parted(self.membership)
        return MEMBERSHIPS.get(base, base) + changed

    @property
    def order(self) -> tuple[Any, ...]:
        """Sorts rows as the paper has them."""
        extent, membership = _parted(self.extent)[0], _parted(self.membership)[0]
        return (
            self.has_centres, _place(extent, EXTENTS), self.extent, not self.separate, self.heads,
            _place(membership, MEMBERSHIPS), self.membership,
        )  # fmt: skip


def strategy_of(config: Mapping[str, Any], choices: Mapping[str, Any], overrides: list[str]) -> Strategy:
    """Name a run's strategy by the choices and overrides that Hydra wrote down.

    Heads that detect no centres use no extent, but for where a box has its middle.
    """
    named = {group: str(choices.get(group, PAPER)) + changed(group, overrides) for group in AXES}
    if _parted(named["heads"])[0] != PAPER:
        named["extent"] = "amodal" if choices["extent"] == "amodal" else ""
    if "membership" not in config["stage"]["run"] and choices["membership"] not in UNTRAINED:
        named["membership"] = "nearest" if _parted(named["heads"])[0] == PAPER else "mean_shift"  # stage 1's stand-in
    return Strategy(separate=bool(config["backbone"].get("separate", False)), **named)


def plain_names(strategies: Sequence[Strategy]) -> tuple[list[str], dict[Strategy, Strategy]]:
    """Leave out changed settings that no two strategies differ in; return those, and the new names."""
    said: dict[str, None] = {}
    names = {each: each for each in strategies}
    for axis in AXES:
        variants: dict[str, set[str]] = {}
        for each in strategies:
            variants.setdefault(_parted(getattr(each, axis))[0], set()).add(getattr(each, axis))
        shared = {next(iter(of)): base for base, of in variants.items() if len(of) == 1}
        said |= dict.fromkeys(name for name, base in shared.items() if name != base)
        for old, new in names.items():
            name = getattr(new, axis)
            names[old] = replace(new, **{axis: shared.get(name, name)})
    return list(said), names


def changed(group: str, overrides: Sequence[str]) -> str:
    """Return the settings of a group that the command line changed, as `` (margin=2)``."""
    changes = sorted(
        text.lstrip("+~")[len(group) + 1 :] for text in overrides if text.lstrip("+~").startswith(f"{group}.")
    )
    return f" ({', '.join(changes)})" if changes else ""


def _parted(name: str) -> tuple[str, str]:
    base, gap, changed = name.partition(" ")
    return base, gap + changed


def _place(name: str, order: Mapping[str, str]) -> int:
    return list(order).index(name) if name in order else len(order)
