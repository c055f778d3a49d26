"""What tells the rows of Tables I and II apart, read from a run's configuration."""

from collections.abc import Mapping
from dataclasses import dataclass
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
UNTRAINED = ("nearest", "clustering", "mean_shift")
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
    def detection(self) -> str:
        """What Table I tells apart: all but the membership."""
        first = self.heads if self.heads != PAPER else self.extent
        return first + ("+separate" if self.separate else "")

    @property
    def title(self) -> str:
        """The row's title in Table I."""
        base, changed = _parted(self.extent)
        name = EXTENTS.get(base, base) + changed
        if self.heads != PAPER:
            offsets, changed = _parted(self.heads)
            how = "Offset reg. (DS-Net)" if offsets == "offset_regression" else offsets
            return how + changed + (", w/o sharing" if self.separate else "")
        if base == "amodal":
            return f"Amodal Det.{changed}" + (", w/o sharing" if self.separate else "")
        shared = ", w/ sharing" if base == "shrink_wrap" else ""
        return f"Modal Det. ({name})" + (", w/o sharing" if self.separate else shared)

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
            self.heads == PAPER, _place(extent, EXTENTS), self.extent, not self.separate, self.heads,
            _place(membership, MEMBERSHIPS), self.membership,
        )  # fmt: skip


def strategy_of(config: Mapping[str, Any], choices: Mapping[str, Any], overrides: list[str]) -> Strategy:
    """Name a run's strategy by the choices and overrides that Hydra wrote down."""
    named = {group: str(choices.get(group, PAPER)) + _changed(group, overrides) for group in AXES}
    if "membership" not in config["stage"]["run"] and choices["membership"] not in UNTRAINED:
        named["membership"] = "nearest" if named["heads"] == PAPER else "mean_shift"  # stage 1's stand-in
    return Strategy(separate=bool(config["backbone"].get("separate", False)), **named)


def _changed(group: str, overrides: list[str]) -> str:
    """The settings of a group that the command line changed, as `` (margin=2)``."""
    changes = sorted(
        text.lstrip("+~")[len(group) + 1 :] for text in overrides if text.lstrip("+~").startswith(f"{group}.")
    )
    return f" ({', '.join(changes)})" if changes else ""


def _parted(name: str) -> tuple[str, str]:
    base, gap, changed = name.partition(" ")
    return base, gap + changed


def _place(name: str, order: Mapping[str, str]) -> int:
    return list(order).index(name) if name in order else len(order)
