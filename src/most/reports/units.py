"""Which runs are independent trainings, and which of two rows belong together.

Runs on one stage 1 are not independent, whatever seeds their stages 2 have.
"""

from collections.abc import Mapping, Sequence

from most.reports.runs import Scored

BySeed = Mapping[int, Scored]  # a strategy's runs


def units(*rows: BySeed) -> list[list[int]]:
    """Part the seeds that all ``rows`` have: those that stand on one stage 1 in any of them are drawn together.

    Memberships on the same detection are compared on the same stage 1 alone: seeds where theirs differ are left out.
    """
    seeds = sorted(seed for seed in set.intersection(*map(set, rows)) if _comparable([row[seed] for row in rows]))
    parts = [{seed} for seed in seeds]
    for row in rows:
        for stage1 in {row[seed].stage1 for seed in seeds}:
            sharing = {seed for seed in seeds if row[seed].stage1 == stage1}
            apart = [part for part in parts if not part & sharing]
            parts = [*apart, set().union(*(part for part in parts if part & sharing))]
    return sorted(sorted(part) for part in parts)


def _comparable(runs: Sequence[Scored]) -> bool:
    return len({run.strategy.detection for run in runs}) == len({(run.strategy.detection, run.stage1) for run in runs})
