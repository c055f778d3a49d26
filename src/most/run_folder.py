"""What stands in a run's folder from its beginning: what it was told, once that is accepted; else nothing."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from lightning.pytorch.utilities import rank_zero_only
from omegaconf import DictConfig, OmegaConf

from most.errors import ConfigError
from most.files import atomic_write

TOLD = ".hydra"  # where Hydra itself would put it, but before anyone has looked whether the run may be here


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
