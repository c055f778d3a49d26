"""What stands in a run's folder from its beginning: what it was told, once that is accepted; else nothing."""

import errno
import os
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, cast

from hydra.core.hydra_config import HydraConfig
from lightning.pytorch.utilities import rank_zero_only
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from most.errors import ConfigError, DataError
from most.files import atomic_write
from most.keys import NO_FIGURE, check_same, flat, is_of

if sys.platform != "win32":
    import fcntl

TOLD = ".hydra"  # where Hydra itself would put it, but before anyone has looked whether the run may be here
PLACES = ("dataset.root", "stage1")  # settings that name files: the same by whatever spelling
INTERACTIVE = ("bash", "interactive")  # names of SLURM's jobs in which Lightning expects one process


def check_shared(overrides: Sequence[str]) -> None:
    """Refuse processes of torchrun or SLURM that no one told their folder: each would make one of its own.

    Those that Lightning starts are told theirs.
    """
    if any(override.lstrip("+").startswith("hydra.run.dir=") for override in overrides):
        return
    for name in ("WORLD_SIZE", "SLURM_NTASKS"):
        alone = name == "SLURM_NTASKS" and os.environ.get("SLURM_JOB_NAME") in INTERACTIVE
        found = os.environ.get(name, "")
        if not alone and found.isdigit() and int(found) > 1:
            raise ConfigError(
                f"hydra.run.dir: expected the folder that all processes share, found none though {name}={found}; "
                "add hydra.run.dir=FOLDER"
            )


@contextmanager
def begun(folder: Path, config: DictConfig, goes_on: bool) -> Iterator[None]:
    """Begin a run in ``folder`` with what it was told, or go on with the one that began there with the same.

    To the end of the work within, ``folder`` is this process's alone.
    """
    if goes_on:
        advice = "repeat the settings it began with, or train anew: without resume, in another folder"
        moved = ("dataset.root", "trainer")  # scans are held against the checkpoint's; machines may be others
        check_beginning(folder, config, HydraConfig.get().runtime.choices, advice, moved)
    with held(folder):
        write_down(folder, config)
        yield


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Refuse a folder that another process trains in, and keep others out until the work within, or this process, ends.

    Of processes that train together the first does so for all. Windows and file systems without locks keep no one out.
    """
    path = folder / TOLD / "lock"
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:  # no one else in this process may open it: closing that would end the lock
        _lock(file, folder)
        yield


@rank_zero_only
def _lock(file: IO[str], folder: Path) -> None:
    """Lock a file for this process; ConfigError where another one has."""
    if sys.platform == "win32":
        return
    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # unlike flock's, no forked loading process has it, too
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN):
            raise ConfigError(
                f"hydra.run.dir: expected a folder that no other process trains in, found {folder}; "
                "wait for that one's end, or choose another folder"
            ) from error


def check_beginning(
    folder: Path, config: DictConfig, choices: Mapping[str, str], advice: str, moved: Collection[str] = ()
) -> None:
    """Refuse other settings or choices than those that the run in ``folder`` began with.

    What one of both lacks is of a later version. ``choices`` are members of groups, ``moved`` names settings that may
    be others than they were.
    """
    written = folder / TOLD
    if not (written / "config.yaml").is_file():
        return
    (began, place), now = _written(written), told(config, choices)
    same = {key for key in PLACES if _one_place(place, began.get(key), now.get(key))}
    keys = [key for key in began.keys() & now.keys() - same if not is_of(key, (*NO_FIGURE, *moved))]
    check_same(str(folder), began, now, keys, advice)


def _written(folder: Path) -> tuple[dict[str, Any], str]:
    """Read what a run was told, and the folder that its relative paths stand in."""
    try:
        config, hydra = (DictConfig(OmegaConf.load(folder / name)) for name in ("config.yaml", "hydra.yaml"))
        return told(config, hydra.hydra.runtime.choices), hydra.hydra.runtime.get("cwd", "")
    except (OSError, OmegaConfBaseException, YAMLError, ValueError, TypeError, AttributeError) as error:
        raise DataError(
            f"{folder}: expected the settings that the run began with, found none readable ({error}); "
            "remove that folder where you know that they were the same, else the run's"
        ) from error


def told(config: DictConfig, choices: Mapping[str, str]) -> dict[str, Any]:
    """Return settings by dotted keys, interpolations as they were written, and choices by their groups."""
    settings = cast(dict[str, Any], OmegaConf.to_container(config))
    return flat(settings) | chosen(choices)


def chosen(choices: Mapping[str, str]) -> dict[str, str]:
    """Return which member of each group a configuration was composed of, Hydra's own groups left out."""
    return {group: member for group, member in choices.items() if not group.startswith("hydra/")}


def _one_place(folder: str, began: Any, now: Any) -> bool:
    """Whether two paths, the first of them told in ``folder``, are spellings of one."""
    return isinstance(began, str) and isinstance(now, str) and Path(folder, began).resolve() == Path(now).resolve()


@rank_zero_only
def write_down(folder: Path, config: DictConfig) -> None:
    """Write what a run was told, by Hydra's names: its configuration, Hydra's own, and the overrides."""
    own, overrides = HydraConfig.instance().cfg, HydraConfig.get().overrides.task
    files = {"config.yaml": config, "hydra.yaml": own, "overrides.yaml": overrides}
    for name, content in files.items():
        with atomic_write(folder / TOLD / name) as file:
            file.write(OmegaConf.to_yaml(content).encode())


@contextmanager
def gone_if_refused(folder: Path) -> Iterator[None]:
    """Remove the folder that Hydra made for a run where the run failed before it left anything there."""
    try:
        yield
    except Exception:
        with suppress(OSError):
            _remove_if_empty(folder)
        raise


def _remove_if_empty(folder: Path) -> None:
    """Remove a folder in which there is at most a log that says nothing."""
    left = list(folder.iterdir())
    if all(path.suffix == ".log" and path.is_file() and not path.stat().st_size for path in left):
        for path in left:
            path.unlink(missing_ok=True)
        folder.rmdir()
