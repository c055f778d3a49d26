"""A training run put together: stage, trainer, callbacks, logger."""

from pathlib import Path

import lightning as L
from lightning.pytorch.callbacks import Callback, LearningRateMonitor, ModelCheckpoint, TQDMProgressBar
from omegaconf import OmegaConf

from most.assembly import build_network, build_predictor, describe, model_parts
from most.config import Config
from most.datasets.class_counts import class_counts
from most.datasets.datamodule import SemanticKITTIDataModule
from most.stages.callbacks import Throughput
from most.stages.detection import DetectionStage
from most.viz.callback import BevPictures


def build_stage(config: Config, data: SemanticKITTIDataModule) -> DetectionStage:
    """Make the network and wire it for training."""
    taxonomy, parts = data.reader.taxonomy, model_parts(config)
    predictor = build_predictor(build_network(parts, taxonomy), parts, taxonomy)
    description = describe(parts, taxonomy, config.dataset.sweeps)
    return DetectionStage(predictor, taxonomy, class_counts(data.reader, "train"), config.stage, description)


def build_trainer(config: Config, folder: Path) -> L.Trainer:
    """Make Lightning's trainer from our settings."""
    settings, plain = config.trainer, OmegaConf.to_container(OmegaConf.structured(config))
    logger = config.logger.build(folder, config.name, plain)
    callbacks: list[Callback] = [
        ModelCheckpoint(folder / "checkpoints", "best", monitor="val/pq", mode="max", save_last=True),
        Throughput(),
    ]
    if logger:
        callbacks += [LearningRateMonitor("step"), BevPictures(config.logger.pictures, folder / "pictures")]
    if settings.progress_bar:
        callbacks.append(TQDMProgressBar(leave=True))
    return L.Trainer(
        accelerator=settings.accelerator,
        devices=settings.devices,
        num_nodes=settings.nodes,
        strategy=settings.strategy,
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
