"""What has to be said beside tables: what intervals cannot tell, and what is not known of rows."""

from collections.abc import Iterator, Mapping

from most.reports.groups import Group
from most.reports.units import BySeed, units

SHARED = "Seeds that stand on one stage 1 are drawn as one: they are no independent trainings."
ALONE = (
    "One training of stage 1: intervals tell of the held-out sequences alone. Another training may come out otherwise, "
    "whatever they say. So it is with"
)
ONE_SEQUENCE = "One held-out sequence: intervals tell of seeds alone. Other sequences may come out otherwise."
UNTOLD = (
    "not every report says with which settings of membership and tracker it was predicted (those of most.track, of "
    "others' predictions and of earlier versions do not); they are taken for the defaults."
)
UNSEEN = "A row without figures has runs of an earlier version, which did not count by occlusion."
UNSUMMED = (
    "PAT and PTQ without an interval: their report is of an earlier version, which kept no sums of them by sequence; "
    "score the predictions again with most.evaluate."
)


def unseen(rows: Mapping[str, BySeed]) -> Iterator[str]:
    """Say why rows have no figures by occlusion."""
    if any(run.sums.visible is None for runs in rows.values() for run in runs.values()):
        yield UNSEEN


def remarks(group: Group) -> Iterator[str]:
    """Say what intervals of a group's runs do not tell."""
    trainings = {f"{each.title}, {each.membership}": units(group.by_seed(each)) for each in group.strategies}
    if any(len(part) > 1 for parts in trainings.values() for part in parts):
        yield SHARED
    if alone := [title for title, parts in trainings.items() if len(parts) == 1]:
        yield f"{ALONE} {'all rows' if len(alone) == len(trainings) else '; '.join(alone)}."
    if len(group.measured.sequences) == 1:
        yield ONE_SEQUENCE


def predictions(rows: Mapping[str, BySeed]) -> Iterator[str]:
    """Name the rows whose predictions may have been made with settings that no file tells."""
    for title, runs in rows.items():
        if any(run.told is None for run in runs.values()):
            yield f"{title}: {UNTOLD}"


def trackers(rows: Mapping[str, BySeed]) -> Iterator[str]:
    """Say with which trackers rows were tracked, where not with the default one."""
    for title, runs in rows.items():
        told = {setting for run in runs.values() for setting in run.told or () if setting.startswith("tracker.")}
        if told:
            yield f"{title}: {', '.join(sorted(told))}."


def unsummed(rows: Mapping[str, BySeed], evaluator: str) -> Iterator[str]:
    """Say why 4D figures of nuScenes have no interval."""
    if evaluator == "nuscenes" and any(run.sums.tq is None for runs in rows.values() for run in runs.values()):
        yield UNSUMMED
