"""A training run put together: stages, trainer, callbacks, logger."""

from pathlib import Path
from typing import Any

import lightning as L
import torch
from lightning.pytorch.callbacks import Callback, LearningRateMonitor, ModelCheckpoint, TQDMProgressBar
from lightning.pytorch.loggers import Logger

from most.assembly import build_membership, build_network, build_predictor, describe, load_trained, model_parts
from most.config import Config
from most.datasets.class_counts import class_counts
from most.datasets.datamodule import SemanticKITTIDataModule
from most.datasets.taxonomy import Taxonomy
from most.errors import ConfigError
from most.membership import Nearest, PointSegMLP
from most.stages.callbacks import Throughput
from most.stages.detection import DetectionStage
from most.stages.membership import MembershipStage
from most.viz.callback import BevPictures

Stage = DetectionStage | MembershipStage


def build_detection(config: Config, data: SemanticKITTIDataModule) -> DetectionStage:
    """Make the network and wire it for stage 1, which knows no membership but the nearest centre."""
    taxonomy, parts = data.reader.taxonomy, model_parts(config) | {"membership": Nearest()}
    predictor = build_predictor(build_network(parts, taxonomy), parts, taxonomy)
    training = config.stage.detection
    balanced = training.losses.class_balance > 0
    counts = class_counts(data.reader, "train") if balanced else torch.ones(taxonomy.num_classes, dtype=torch.long)
    return DetectionStage(predictor, taxonomy, counts, training, describe(parts, taxonomy, config.dataset.sweeps))


def build_membership_stage(config: Config, stage1: Path, taxonomy: Taxonomy) -> MembershipStage:
    """Read stage 1 from a checkpoint and put a new membership after it."""
    predictor, parts = load_trained(stage1).predictor, model_parts(config)
    membership = build_membership(parts, predictor.network, taxonomy)
    if not isinstance(membership, PointSegMLP):
        raise ConfigError(
            "membership: expected one that stage 2 can train, such as full, found nearest; or stage=detection"
        )
    description = describe(parts, taxonomy, config.dataset.sweeps)
    return MembershipStage(predictor, membership, taxonomy, config.stage.membership, description)


def checkpoint_path(folder: Path, stage: str, which: str) -> Path:
    """Where a run keeps a stage's ``last`` or ``best`` weights."""
    return folder / "checkpoints" / f"{stage}-{which}.ckpt"


def handed_over(config: Config, folder: Path) -> Path:
    """Return the stage 1 that stage 2 of the same run gets: the last one where a run never validated on the way."""
    best = checkpoint_path(folder, "detection", "best")
    return best if config.stage.hand_over == "best" and best.is_file() else checkpoint_path(folder, "detection", "last")


def build_trainer(config: Config, stage: Stage, folder: Path, logger: Logger | bool) -> L.Trainer:
    """Make Lightning's trainer from our settings."""
    settings, training = config.trainer, stage.training_settings
    return L.Trainer(
        accelerator=settings.accelerator,
        devices=1,
        precision=settings.precision,
        max_epochs=training.epochs,
        accumulate_grad_batches=settings.accumulated(training.batch_size, config.dataset.batch_size, stage.name),
        gradient_clip_val=training.clip,
        check_val_every_n_epoch=settings.validate_every,
        log_every_n_steps=settings.log_every,
        num_sanity_val_steps=0,
        use_distributed_sampler=False,
        logger=logger,
        callbacks=_callbacks(config, stage, folder),
        enable_progress_bar=settings.progress_bar,
        enable_model_summary=False,
        default_root_dir=folder,
    )


def _callbacks(config: Config, stage: Stage, folder: Path) -> list[Callback]:
    def keep(which: str, **when: Any) -> ModelCheckpoint:
        """Keep one file; a run that goes on in its folder overwrites it."""
        path = checkpoint_path(folder, stage.name, which)
        return ModelCheckpoint(path.parent, path.stem, enable_version_counter=False, **when)

    callbacks: list[Callback] = [
        keep("last", every_n_epochs=1, save_on_train_epoch_end=True),
        keep("best", monitor=f"{stage.prefix}val/pq", mode="max"),
        Throughput(stage.prefix),
    ]
    if config.logger.kind != "none":
        callbacks.append(LearningRateMonitor("step"))
    if config.logger.pictures:
        callbacks.append(BevPictures(config.logger.pictures, folder / "pictures" / stage.name, stage.prefix))
    if config.trainer.progress_bar:
        callbacks.append(TQDMProgressBar(leave=True))
    return callbacks
