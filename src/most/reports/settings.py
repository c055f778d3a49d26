"""Settings that change how a run is done, not its figures: runs that differ in nothing else are the same run."""

from collections.abc import Iterable

NO_FIGURE = (
    "logger", "paths", "resume", "name", "dataset.tables", "dataset.workers", "dataset.cache",
    "trainer.threads", "trainer.progress_bar", "trainer.log_every", "trainer.save_every",
)  # fmt: skip


def is_of(key: str, groups: Iterable[str]) -> bool:
    """Whether a dotted key is one of ``groups``, or lies in one."""
    return any(key == group or key.startswith(f"{group}.") for group in groups)
