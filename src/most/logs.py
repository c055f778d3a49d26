"""Lightning loggers: W&B (offline unless asked), CSV, or none."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from most.errors import ConfigError

if TYPE_CHECKING:
    from lightning.pytorch.loggers import Logger

KINDS = ("wandb", "csv", "none")


def check_key(setting: str, otherwise: str) -> None:
    """Refuse to go online where W&B finds no key that can be one: neither WANDB_API_KEY nor that of ``wandb login``.

    In a terminal W&B asks for one first. ``setting`` is what needs it, ``otherwise`` says what can be done without.
    """
    if found := _lacking_key():
        raise ConfigError(
            f"{setting}: expected a key for W&B online, found {found}; "
            f"run wandb login, set WANDB_API_KEY, or {otherwise}"
        )


def _lacking_key() -> str | None:
    """Return what W&B finds instead of a key."""
    import wandb

    os.environ["WANDB_MODE"] = "online"
    try:
        return None if wandb.login(verify=False) else "none"
    except wandb.errors.UsageError:  # no key, and no terminal to ask in
        return "none"
    except (wandb.errors.Error, ValueError) as error:  # the latter of earlier versions
        return f"one that W&B does not take: {error}"


@contextmanager
def ended() -> Iterator[None]:
    """End W&B's run with the work within, as failed where that raises: a sweep's next job is another run."""
    import wandb

    try:
        yield
    except BaseException:
        wandb.finish(exit_code=1)
        raise
    wandb.finish()


@dataclass
class LoggerSettings:
    """Where losses, metrics and pictures go."""

    kind: str = "wandb"
    project: str = "most"
    group: str | None = None
    mode: str = "offline"  # online needs an account
    pictures: int = 2  # BEV pictures of the validation split, a validation

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ConfigError(f"logger.kind: expected one of {', '.join(KINDS)}, found {self.kind}")
        if self.mode not in ("offline", "online"):
            raise ConfigError(f"logger.mode: expected offline or online, found {self.mode}")
        if self.pictures < 0:
            raise ConfigError(f"logger.pictures: expected a number >= 0, found {self.pictures}")

    def check_account(self) -> None:
        """Refuse to log online without a key."""
        if self.kind == "wandb" and self.mode == "online":
            check_key("logger.mode", "leave it offline, and wandb sync the run's folder later")

    def build(self, folder: Path, name: str, config: dict[str, Any]) -> "Logger | bool":
        """Start the logger of a run whose files go to ``folder``."""
        from lightning.pytorch.loggers import CSVLogger, WandbLogger  # seconds, which only a training has to wait

        if self.kind == "none":
            return False
        if self.kind == "csv":
            return CSVLogger(folder, name="csv", version="")
        os.environ["WANDB_MODE"] = self.mode  # WandbLogger's own switch refuses log_model
        return WandbLogger(name=name, save_dir=folder, project=self.project, group=self.group, config=config)
