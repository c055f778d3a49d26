"""Figures with intervals of a group's strategies, and differences between two under the same draws."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from jaxtyping import Float64

from most.metrics.bootstrap import Interval, Resampling
from most.reports.figures import Figures, Presence, figures
from most.reports.groups import Group
from most.reports.runs import Scored
from most.reports.table import Cells
from most.reports.units import BySeed, units


class Analysis:
    """Resamples a group's runs; each run's figures are formed once.

    Where seeds stand on one stage 1, their mean is one draw's unit: they were not trained independently.
    """

    def __init__(self, group: Group, draws: int, seed: int) -> None:
        self.group = group
        self.resampling = Resampling(len(group.measured.sequences), draws, seed)
        self._formed: dict[int, Figures] = {}

    def cells(self, runs: BySeed, columns: Mapping[str, str]) -> Cells:
        """Means over seeds with their intervals; ``columns`` are the figures' keys by title."""
        return {title: self._interval(runs, key) for title, key in columns.items()}

    def differences(self, runs: BySeed, others: BySeed, columns: Mapping[str, str]) -> Cells:
        """How much higher the figures of ``runs`` are, over the seeds that are paired; None without such."""
        common = units(runs, others)
        found: Cells = {}
        for title, key in columns.items():
            ours, theirs = (self._drawn(each, common, key) for each in (runs, others))
            found[title] = None if ours is None or theirs is None else self._known(ours - theirs, (-1, 1))
        return found

    def by_seed(self, runs: BySeed, key: str) -> dict[int, float]:
        """A figure of each seed, as measured."""
        found = {seed: self._figures(each) for seed, each in sorted(runs.items())}
        return {seed: float(each[key][0]) for seed, each in found.items() if key in each}

    def _interval(self, runs: BySeed, key: str) -> Interval | None:
        if (drawn := self._drawn(runs, units(runs), key)) is not None:
            return self._known(drawn, (0, 1))
        official = [_reported(each, key) for each in runs.values()]
        known = [value for value in official if value is not None]
        return Interval(float(np.mean(known))) if known and len(known) == len(official) else None

    def _known(self, drawn: Float64[np.ndarray, "draws units"], within: tuple[float, float]) -> Interval | None:
        found = self.resampling.interval(drawn, within)
        return found if math.isfinite(found.value) else None

    def _drawn(
        self, runs: BySeed, parts: Sequence[Sequence[int]], key: str
    ) -> Float64[np.ndarray, "draws units"] | None:
        """A figure in each draw, a column for each part of the seeds; None where a run does not have it."""
        found = [[self._figures(runs[seed]) for seed in part] for part in parts]
        if not found or not all(key in each for part in found for each in part):
            return None
        return np.stack([np.mean([each[key] for each in part], 0) for part in found], 1)

    def _figures(self, run: Scored) -> Figures:
        if id(run) not in self._formed:
            sums = run.sums if run.strategy.has_regions else replace(run.sums, membership=None)
            self._formed[id(run)] = figures(sums, self._presence, self._weights)
        return self._formed[id(run)]

    @cached_property
    def _weights(self) -> Float64[np.ndarray, "draws sequences"]:
        return self.resampling.of_sequences()

    @cached_property
    def _presence(self) -> Presence:
        rows = self.group.rows.values()
        return Presence.of(
            [run.sums for row in rows for source in row.values() for found in source.values() for run in found]
        )


def _reported(run: Scored, key: str) -> float | None:
    """A 4D figure that cannot be formed of sums, as the official evaluator has it."""
    value = (run.report.get("tracking") or {}).get(key)
    return None if value is None else float(value)
