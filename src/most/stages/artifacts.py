"""The files of a finished run as W&B artifacts."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import wandb
from lightning.pytorch.loggers import Logger, WandbLogger
from lightning.pytorch.utilities import rank_zero_only


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
