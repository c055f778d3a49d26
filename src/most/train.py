"""Train MOST: ``python -m most.train +experiment=semkitti_max``."""

import json
from pathlib import Path

import hydra
import lightning as L
import torch
from hydra.core.hydra_config import HydraConfig
from lightning.pytorch.callbacks import Callback, LearningRateMonitor, ModelCheckpoint, TQDMProgressBar
from omegaconf import DictConfig, OmegaConf

from most.assembly import build_network, build_predictor, describe, model_parts
from most.config import Config, conf_dir, register, typed
from most.datasets.class_counts import class_counts
from most.datasets.datamodule import SemanticKITTIDataModule
from most.entry import run
from most.files import atomic_write
from most.stages.callbacks import Throughput
from most.stages.detection import DetectionStage
from most.viz.callback import BevPictures

register()


def train(config: Config, folder: Path) -> None:
    """Train stage 1 and write ``checkpoints/`` and ``metrics.json`` to ``folder``."""
    L.seed_everything(config.seed, workers=True)
    if config.trainer.threads:
        torch.set_num_threads(config.trainer.threads)
    data = SemanticKITTIDataModule(config.dataset, config.augment, config.extent, config.seed)
    data.prepare_data()
    stage = build_stage(config, data)
    trainer = build_trainer(config, folder)
    trainer.fit(stage, datamodule=data, ckpt_path=config.resume)
    with atomic_write(folder / "metrics.json", "w") as file:
        json.dump(stage.report, file, indent=2)


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


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="train")
def main(config: DictConfig) -> None:
    """Compose, check, train."""
    run(lambda: train(typed(config), Path(HydraConfig.get().runtime.output_dir)))


if __name__ == "__main__":
    main()
