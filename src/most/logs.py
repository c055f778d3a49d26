"""Lightning loggers: W&B (offline unless asked), CSV, or none; and the files of a finished run as W&B artifacts."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import wandb
from lightning.pytorch.loggers import CSVLogger, Logger, WandbLogger
from lightning.pytorch.utilities import rank_zero_only

from most.errors import ConfigError

KINDS = ("wandb", "csv", "none")


@dataclass
class LoggerSettings:
    """Where losses, metrics and pictures go."""

    kind: str = "wandb"
    project: str = "most"
    group: str | None = None
    mode: str = "offline"  # online needs WANDB_API_KEY
    pictures: int = 2  # BEV pictures of the validation split, a validation

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ConfigError(f"logger.kind: expected one of {', '.join(KINDS)}, found {self.kind}")
        if self.mode not in ("offline", "online"):
            raise ConfigError(f"logger.mode: expected offline or online, found {self.mode}")
        if self.pictures < 0:
            raise ConfigError(f"logger.pictures: expected a number >= 0, found {self.pictures}")

    def build(self, folder: Path, name: str, config: dict[str, Any]) -> Logger | bool:
        """Start the logger of a run whose files go to ``folder``."""
        if self.kind == "none":
            return False
        if self.kind == "csv":
            return CSVLogger(folder, name="csv", version="")
        online = self.mode == "online" and "WANDB_API_KEY" in os.environ
        os.environ["WANDB_MODE"] = "online" if online else "offline"  # WandbLogger's own switch refuses log_model
        return WandbLogger(name=name, save_dir=folder, project=self.project, group=self.group, config=config)


@rank_zero_only
def log_artifacts(logger: Logger | bool, files: Mapping[str, Sequence[Path]]) -> None:
    """Tell W&B of a run's files, by kind; those that are not there are left out. Offline they stay where they are."""
    if not isinstance(logger, WandbLogger):
        return
    for kind, paths in files.items():
        artifact = wandb.Artifact(f"{kind}-{logger.experiment.id}", kind)
        for path in filter(Path.is_file, paths):
            artifact.add_file(str(path), policy="immutable")  # a reference: checkpoints are large
        logger.experiment.log_artifact(artifact)
