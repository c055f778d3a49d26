"""A training run put together: stage, trainer, callbacks, logger."""

from pathlib import Path
from typing import Any

import lightning as L
import torch
from lightning.pytorch.callbacks import Callback, LearningRateMonitor, ModelCheckpoint, TQDMProgressBar
from omegaconf import OmegaConf

from most.assembly import build_network, build_predictor, describe, model_parts, read_checkpoint
from most.config import Config
from most.datasets.class_counts import class_counts
from most.datasets.datamodule import SemanticKITTIDataModule
from most.datasets.taxonomy import Taxonomy
from most.errors import ConfigError
from most.stages.callbacks import Throughput
from most.stages.detection import DetectionStage
from most.viz.callback import BevPictures


def build_stage(config: Config, data: SemanticKITTIDataModule) -> DetectionStage:
    """Make the network and wire it for training."""
    taxonomy, parts = data.reader.taxonomy, model_parts(config)
    predictor = build_predictor(build_network(parts, taxonomy), parts, taxonomy)
    description = describe(parts, taxonomy, config.dataset.sweeps)
    balanced = config.stage.losses.class_balance > 0
    counts = class_counts(data.reader, "train") if balanced else torch.ones(taxonomy.num_classes, dtype=torch.long)
    return DetectionStage(predictor, taxonomy, counts, config.stage, description)


def checkpoint(folder: Path, name: str, **when: Any) -> ModelCheckpoint:
    """Keep one file ``checkpoints/<name>.ckpt``; a run that goes on in its folder overwrites it."""
    return ModelCheckpoint(folder / "checkpoints", name, enable_version_counter=False, **when)


def build_trainer(config: Config, folder: Path) -> L.Trainer:
    """Make Lightning's trainer from our settings."""
    settings, plain = config.trainer, OmegaConf.to_container(OmegaConf.structured(config))
    logger = config.logger.build(folder, config.name, plain)
    callbacks: list[Callback] = [
        checkpoint(folder, "last", every_n_epochs=1, save_on_train_epoch_end=True),
        checkpoint(folder, "best", monitor="val/pq", mode="max"),
        Throughput(),
    ]
    if logger:
        callbacks.append(LearningRateMonitor("step"))
    if config.logger.pictures:
        callbacks.append(BevPictures(config.logger.pictures, folder / "pictures"))
    if settings.progress_bar:
        callbacks.append(TQDMProgressBar(leave=True))
    return L.Trainer(
        accelerator=settings.accelerator,
        devices=1,
        precision=settings.precision,
        max_epochs=config.stage.epochs,
        accumulate_grad_batches=settings.accumulated(config.stage.batch_size, config.dataset.batch_size),
        gradient_clip_val=config.stage.clip,
        check_val_every_n_epoch=settings.validate_every,
        log_every_n_steps=settings.log_every,
        num_sanity_val_steps=0,
        use_distributed_sampler=False,
        logger=logger,
        callbacks=callbacks,
        enable_progress_bar=settings.progress_bar,
        enable_model_summary=False,
        default_root_dir=folder,
    )


def check_resume(config: Config, taxonomy: Taxonomy) -> None:
    """Refuse to go on from a checkpoint of another model, or towards another number of epochs."""
    path = Path(str(config.resume))
    saved = read_checkpoint(path)
    if saved["most"] != describe(model_parts(config), taxonomy, config.dataset.sweeps):
        raise ConfigError(f"resume: {path} was trained with another model or dataset; repeat its own settings")
    if saved["most_epochs"] != config.stage.epochs:
        raise ConfigError(
            f"stage.epochs: expected {saved['most_epochs']}, as the run of {path} began, found {config.stage.epochs}; "
            "the learning rate's schedule is made for that length"
        )
