"""A split's sequences held against those that are on disk."""

import warnings
from collections.abc import Callable
from pathlib import Path

from most.datasets.reader import SPLITS
from most.errors import ConfigError

NAMED = 12  # sequences that a warning lists before it counts


def check_split(split: str) -> None:
    """Raise a ConfigError unless there is a split of that name."""
    if split not in SPLITS:
        raise ConfigError(f"split: expected one of {', '.join(SPLITS)}, found {split!r}")


def check_once(split: str, names: list[str]) -> None:
    """Raise a ConfigError where a split names a sequence twice."""
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ConfigError(f"dataset.splits.{split}: expected each sequence once, found {', '.join(twice)} twice")


def present_sequences(root: Path, split: str, wanted: list[str], is_there: Callable[[str], bool]) -> list[str]:
    """Those of a split's sequences that are there; warns about the others, unless none is there at all."""
    present = [name for name in wanted if is_there(name)]
    missing = sorted(set(wanted) - set(present))
    if present and missing:
        names = ", ".join(missing[:NAMED]) + (f" and {len(missing) - NAMED} more" if len(missing) > NAMED else "")
        warnings.warn(f"{root}: {split}: sequences {names} are not there", stacklevel=2)
    return present
