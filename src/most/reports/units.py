"""Which runs are independent trainings, and which of two rows belong together.

Runs on one stage 1 are not independent, whatever seeds their stages 2 have.
"""

from collections.abc import Mapping

from most.reports.runs import Scored

BySeed = Mapping[int, Scored]  # a strategy's runs


def paired(runs: BySeed, others: BySeed) -> tuple[BySeed, BySeed]:
    """Keep the seeds that both have; of memberships on the same detection, those that stand on the same stage 1."""
    both = [seed for seed in runs if seed in others and _are_alike(runs[seed], others[seed])]
    return {seed: runs[seed] for seed in both}, {seed: others[seed] for seed in both}


def _are_alike(run: Scored, other: Scored) -> bool:
    return run.strategy.detection != other.strategy.detection or run.stage1 == other.stage1


def units(*rows: BySeed) -> list[list[int]]:
    """Part the seeds that all ``rows`` have: those that stand on one stage 1 in any of them are drawn together."""
    seeds = sorted(set.intersection(*(set(row) for row in rows)))
    parts = [{seed} for seed in seeds]
    for row in rows:
        for stage1 in {row[seed].stage1 for seed in seeds}:
            sharing = {seed for seed in seeds if row[seed].stage1 == stage1}
            apart = [part for part in parts if not part & sharing]
            parts = [*apart, set().union(*(part for part in parts if part & sharing))]
    return sorted(sorted(part) for part in parts)
