"""Runs that may be compared: alike in all but strategy and seed, and measured on the same scans."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from most.errors import DataError
from most.keys import NO_FIGURE, flat, is_of
from most.reports.runs import BESIDE, EVALUATED, VALIDATED, Scored
from most.reports.strategy import AXES, Strategy, plain_names
from most.reports.sums import Measured
from most.reports.units import BySeed

ASIDE = (  # what else runs that are compared may differ in: who ran them and where, and what makes rows of them
    *("seed", "stage1", "dataset.root", "stage.run", "backbone.separate"),
    *(f"trainer.{name}" for name in ("accelerator", "devices", "strategy")),
    *(*NO_FIGURE, *AXES),
)
SOURCES = (EVALUATED, VALIDATED, BESIDE)  # of two with the same strategy and seed, the first is taken


@dataclass
class Group:
    """Comparable runs; the paper's tables are made of one group at a time."""

    title: str
    dataset: str
    measured: Measured
    settings: list[str] = field(default_factory=list)  # of strategies, where the command line changed them in all runs
    rows: dict[Strategy, dict[str, dict[int, list[Scored]]]] = field(default_factory=dict)  # by source and seed

    def add(self, scored: Scored) -> None:
        """Add a run; two of the same strategy and seed are a DataError, since no one could say which counts.

        Nearest centres beside the runs that trained stage 2 may be of several stages 1.
        """
        found = self.rows.setdefault(scored.strategy, {}).setdefault(scored.source, {}).setdefault(scored.seed, [])
        found.append(scored)
        if len(found) > 1 and scored.source != BESIDE:
            unused = "" if scored.strategy.has_centres else f" ({scored.strategy.heads} uses no extent)"
            raise DataError(
                f"{scored.folder}: expected one run of {scored.strategy.detection}{unused}, membership "
                f"{scored.strategy.membership}, seed {scored.seed}, found another in {found[0].folder}; "
                "keep one in runs"
            )

    def by_seed(self, strategy: Strategy, beside: bool = False, like: BySeed | None = None) -> dict[int, Scored]:
        """Return a strategy's runs; of two with a seed, ``beside`` takes that of the run that trained stage 2.

        Of several beside others, the one on the stage 1 that ``like`` has of that seed is taken.
        """
        sources = (EVALUATED, BESIDE, VALIDATED) if beside else SOURCES
        found: dict[int, Scored] = {}
        for source in reversed(sources):
            for seed, runs in self.rows[strategy].get(source, {}).items():
                wanted = like[seed].stage1 if like and seed in like else None
                found[seed] = next((run for run in runs if run.stage1 == wanted), runs[0])
        return found

    @property
    def strategies(self) -> list[Strategy]:
        """In the paper's order."""
        return sorted(self.rows, key=lambda strategy: strategy.order)


def group(scored: list[Scored]) -> list[Group]:
    """Part runs into groups, the one with most strategies first."""
    parts: dict[str, list[Scored]] = {}
    kept: dict[str, dict[str, Any]] = {}
    for each in scored:
        rest = common_part(each.config) | {"experiment": each.choices.get("experiment")}
        key = json.dumps(rest, sort_keys=True, default=str) + repr(each.sums.measured)
        kept[key] = rest
        parts.setdefault(key, []).append(each)
    groups = {key: _group(part) for key, part in parts.items()}
    _entitle(groups, kept)
    return sorted(groups.values(), key=lambda each: (-len(each.rows), each.title))


def _group(scored: list[Scored]) -> Group:
    """Put together what may be compared."""
    first = scored[0]
    name = first.choices.get("experiment") or first.config.get("name")
    found = Group(str(name), str(first.choices["dataset"]), first.sums.measured)
    found.settings, names = plain_names([each.strategy for each in scored])
    for each in scored:
        found.add(replace(each, strategy=names[each.strategy]))
    return found


def common_part(config: Mapping[str, Any]) -> dict[str, Any]:
    """What has to agree, by dotted key."""
    return {key: value for key, value in flat(config).items() if not is_of(key, ASIDE)}


def _entitle(groups: Mapping[str, Group], kept: Mapping[str, Mapping[str, Any]]) -> None:
    """Add dataset and sequences to each group's title, and what tells it from the others."""
    names = {name for rest in kept.values() for name in rest}
    told = sorted(name for name in names if len({repr(rest.get(name)) for rest in kept.values()}) > 1)
    for key, found in groups.items():
        sequences = [name for name, _ in found.measured.sequences]
        shown = ", ".join(sequences) if len(sequences) <= 6 else f"{sequences[0]} to {sequences[-1]}"
        scans = sum(count for _, count in found.measured.sequences)
        plural = "" if len(sequences) == 1 else "s"
        found.title += f" on {found.dataset}: {len(sequences)} sequence{plural} ({shown}), {scans} scans"
        differs = [f"{name}={kept[key].get(name)}" for name in told if name != "experiment"]
        if differs:
            found.title += f" [{'; '.join(differs[:4])}{'; ...' if len(differs) > 4 else ''}]"
