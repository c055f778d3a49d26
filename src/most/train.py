"""Train MOST: ``python -m most.train +experiment=semkitti_max``."""

from pathlib import Path
from typing import Any

import hydra
import lightning as L
import torch
import wandb
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from lightning.pytorch.loggers import Logger
from omegaconf import DictConfig, OmegaConf

from most.checks import stages_to_run
from most.config import Config, conf_dir, register, typed
from most.datasets.datamodule import SweepDataModule
from most.entry import run, start
from most.metrics.report import write_report
from most.training import build_stage, build_trainer, handed_over

register()


def train(config: Config, folder: Path) -> None:
    """Train the stages that are asked for, one after the other.

    Writes ``checkpoints/`` and ``metrics.json``, the figures of the last stage's last weights, to ``folder``.
    """
    if config.trainer.threads:
        torch.set_num_threads(config.trainer.threads)
    data = SweepDataModule(config.dataset, config.augment, config.extent, config.seed)
    names = stages_to_run(config, data.reader, folder)
    settings: Any = OmegaConf.to_container(OmegaConf.structured(config))
    try:
        logger = config.logger.build(folder, config.name, settings)
        for name in names:
            run_stage(name, config, data, folder, logger, config.resume if name == names[0] else None)
    finally:
        wandb.finish()  # the next job of a sweep runs in this process, and is another run


def run_stage(
    name: str, config: Config, data: SweepDataModule, folder: Path, logger: Logger | bool, resume: str | None
) -> None:
    """Train one stage from its beginning, or from a checkpoint, to its end, and write what it reached."""
    L.seed_everything(config.seed, workers=True)
    stage = build_stage(name, config, data, Path(resume or config.stage1 or handed_over(config, folder)))
    trainer = build_trainer(config, stage, folder, logger)
    trainer.fit(stage, datamodule=data, ckpt_path=resume, weights_only=True)
    if stage.report.get("epochs") != stage.epochs:
        trainer.validate(stage, datamodule=data, verbose=False)
    if trainer.is_global_zero:
        write_report(folder / "metrics.json", stage.report)


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="train")
def main(config: DictConfig) -> None:
    """Compose, check, train."""
    job = HydraConfig.get()
    if job.mode == RunMode.MULTIRUN and config.logger.group is None:
        config.logger.group = job.sweep.dir
    run(lambda: train(typed(config), Path(job.runtime.output_dir)))


if __name__ == "__main__":
    start(main)
