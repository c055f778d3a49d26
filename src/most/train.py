"""Train MOST: ``python -m most.train +experiment=semkitti_max``."""

from pathlib import Path

import hydra
import lightning as L
import torch
import wandb
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig

from most.config import Config, conf_dir, register, typed
from most.datasets.datamodule import SemanticKITTIDataModule
from most.entry import run
from most.metrics.report import write_report
from most.training import build_stage, build_trainer, check_resume

register()


def train(config: Config, folder: Path) -> None:
    """Train stage 1 and write ``checkpoints/`` and ``metrics.json``, the last weights' figures, to ``folder``."""
    L.seed_everything(config.seed, workers=True)
    if config.trainer.threads:
        torch.set_num_threads(config.trainer.threads)
    data = SemanticKITTIDataModule(config.dataset, config.augment, config.extent, config.seed)
    for split in ("train", "val"):
        data.reader.sequences(split)  # raises where the dataset is not there, before any work
    if config.resume:
        check_resume(config, data.reader.taxonomy)
    try:
        trainer = build_trainer(config, folder)
        stage = build_stage(config, data)
        trainer.fit(stage, datamodule=data, ckpt_path=config.resume, weights_only=True)
        if stage.report.get("epochs") != config.stage.epochs:
            trainer.validate(stage, datamodule=data, verbose=False)
        write_report(folder / "metrics.json", stage.report)
    finally:
        wandb.finish()  # the next job of a sweep runs in this process, and is another run


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="train")
def main(config: DictConfig) -> None:
    """Compose, check, train."""
    job = HydraConfig.get()
    if job.mode == RunMode.MULTIRUN and config.logger.group is None:
        config.logger.group = job.sweep.dir
    run(lambda: train(typed(config), Path(job.runtime.output_dir)))


if __name__ == "__main__":
    main()
