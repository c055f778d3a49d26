"""The jobs of a sweep: what each is called, whether it can run, what is left of it to do, and how they all ended.

A job's folder is named by its overrides, so the same sweep finds its jobs again: one with ``metrics.json`` is
finished, one with a ``*-last.ckpt`` goes on from it. ``hydra_plugins.most_sweeper`` multiplies the overrides out.
"""

import hashlib
import logging
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from most.checks import stages_to_run
from most.config import Config, typed
from most.datasets.reader import Reader
from most.entry import end
from most.errors import ConfigError, FailedError, MostError, StoppedError, said
from most.keys import NO_FIGURE, is_of
from most.run_folder import check_beginning
from most.training import METRICS, standing

LONGEST = 120  # characters of a folder's name
ELSEWHERE = ("experiment", "dataset.root")  # they stand in the sweep's folder, or are too long for a name
UNNAMED = (*NO_FIGURE, *ELSEWHERE)  # what a job's name does not say

log = logging.getLogger(__name__)


@dataclass
class Job:
    """One combination of a sweep's overrides."""

    arguments: list[str]  # its overrides, as Hydra's launchers take them
    composed: DictConfig  # with Hydra's own settings

    @property
    def folder(self) -> Path:
        """Where the job writes."""
        sweep = self.composed.hydra.sweep
        return Path(sweep.dir) / str(sweep.subdir)

    @property
    def finished(self) -> bool:
        """Whether there is nothing left to do."""
        return (self.folder / METRICS).is_file()

    def settings(self) -> DictConfig:
        """The configuration that the job's training gets, without Hydra's own."""
        own = self.composed.copy()
        OmegaConf.set_struct(own, False)
        del own["hydra"]
        return own


def job_name(overrides: Sequence[str]) -> str:
    """Return what a job is called, in whatever order it was told: ``extent-track_max+seed-1``.

    It can stand in a command without quotes, though Hydra takes no = there.
    Choices come first: a long name ends in a digest.
    """
    told = [override.lstrip("+") for override in overrides]
    kept = [override for override in told if not is_of(override.split("=")[0], UNNAMED)]
    kept.sort(key=lambda override: ("." in override or "/" in override, override))
    name = re.sub(r"[^\w.+-]", "_", "+".join(kept).replace("=", "-")) or "default"
    if len(name) <= LONGEST:
        return name
    digest = hashlib.sha256(name.encode()).hexdigest()[:12]
    return f"{name[: LONGEST - len(digest) - 1]}+{digest}"


def check_jobs(jobs: Sequence[Job]) -> None:
    """Refuse a sweep that a job cannot take part in, before any starts; the message names the first."""
    readers: dict[str, Reader] = {}  # opening one can take long, and most sweeps have one dataset
    seen: set[Path] = set()
    for job in jobs:
        if job.folder in seen:
            raise ConfigError(
                f"{job.folder}: expected jobs that differ in what they train, found two of this name; "
                f"sweep over something else than {', '.join(UNNAMED)}"
            )
        seen.add(job.folder)
        try:
            _check(job, readers)
        except MostError as error:
            raise type(error)(f"job {job.folder.name}: {error}") from error


def _check(job: Job, readers: dict[str, Reader]) -> None:
    _check_beginning(job)
    if job.finished:
        return
    config: Config = typed(job.settings())
    if config.trainer.processes() > 1:
        raise ConfigError(
            f"trainer.devices: expected one process for each job of a sweep, found {config.trainer.processes()}; "
            "say trainer=gpu, or train the combinations without -m"
        )
    config.resume = config.resume or standing(job.folder)
    key = repr(config.dataset)
    if key not in readers:
        readers[key] = config.dataset.reader()
    stages_to_run(config, readers[key], job.folder)


def _check_beginning(job: Job) -> None:
    """Refuse a folder in which a run of other settings began."""
    if job.finished or standing(job.folder):
        advice = "repeat the settings it began with, or choose another hydra.sweep.dir"
        check_beginning(job.folder, job.settings(), job.composed.hydra.runtime.choices, advice)


def in_sweep(config: Config, sweep: str, folder: Path) -> Config:
    """Return a job's configuration: one of a group, named by its folder, it goes on where it was stopped."""
    config.logger.group = config.logger.group or sweep
    config.name = folder.name
    config.resume = config.resume or standing(folder)
    return config


def by_key(overrides: Sequence[str]) -> dict[str, str]:
    """Return what overrides say of which key."""
    return dict(override.lstrip("+").split("=", 1) for override in overrides if "=" in override)


def as_job(work: Callable[[], Any]) -> Any:
    """Do one job's work; its failure becomes an error that processes can pass on, and its traceback goes to the log."""
    try:
        return work()
    except StoppedError as error:
        return end("interrupted; repeat the command to go on with the sweep", error.exit_code)
    except MostError as error:
        log.error(said(error))
        raise MostError(said(error)) from None
    except Exception as error:
        log.exception("the job failed")
        first = _first(error)
        raise MostError(f"{type(first).__name__}: {said(first)}") from None


@contextmanager
def stopping(jobs: Sequence[Job]) -> Iterator[None]:
    """Say what an interrupted sweep, or one whose launcher lost a process, has reached."""
    try:
        yield
    except KeyboardInterrupt as error:
        raise StoppedError("interrupted; repeat the command to go on with the sweep", 130) from error
    except Exception as error:  # each launcher has its own
        left = [job.folder.name for job in jobs if not job.finished]
        raise FailedError(
            f"the launcher stopped ({type(error).__name__}: {error}); repeat the command to go on with "
            f"{len(left)} of {len(jobs)} jobs: {', '.join(left)}"
        ) from error


def report(jobs: Sequence[Job], results: Sequence[Any]) -> None:
    """Say which jobs failed, and why; ``results`` are exceptions for those."""
    ends = zip(jobs, results, strict=True)
    if failed := [f"{job.folder}: {result}" for job, result in ends if isinstance(result, Exception)]:
        raise FailedError(
            "\n  ".join([f"{len(failed)} of {len(jobs)} jobs failed; repeat the command to try them again", *failed])
        )


def _first(error: BaseException) -> BaseException:
    """Return what went wrong first, where cleaning up after it failed as well."""
    while error.__context__ is not None and not error.__suppress_context__:
        error = error.__context__
    return error
