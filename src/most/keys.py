"""Dotted keys of settings: nested settings by them, which group one lies in, and those that change no figure."""

from collections.abc import Iterable, Mapping
from typing import Any

from most.errors import ConfigError

NO_FIGURE = (  # how a run is done, not what it reaches: runs that differ in nothing else are the same run
    "logger", "paths", "resume", "name", "dataset.tables", "dataset.workers", "dataset.cache",
    "trainer.threads", "trainer.progress_bar", "trainer.log_every", "trainer.save_every",
)  # fmt: skip


def flat(settings: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Return nested settings by dotted keys."""
    leaves: dict[str, Any] = {}
    for key, value in settings.items():
        leaves |= flat(value, f"{before}{key}.") if isinstance(value, Mapping) else {f"{before}{key}": value}
    return leaves


def is_of(key: str, groups: Iterable[str]) -> bool:
    """Whether a dotted key is one of ``groups``, or lies in one."""
    return any(key == group or key.startswith(f"{group}.") for group in groups)


def check_same(who: str, began: Mapping[str, Any], now: Mapping[str, Any], keys: Iterable[str], advice: str) -> None:
    """Refuse to go on with other settings than ``who`` began with; of several that differ the first is named."""
    for key in sorted(keys):
        if began.get(key) != now.get(key):
            raise ConfigError(f"{who} began with {key} = {began.get(key)}, found {now.get(key)}; {advice}")
