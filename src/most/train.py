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
from most.stages.artifacts import log_artifacts
from most.stages.stage import Stage
from most.sweeps import as_job, by_key, chosen, in_sweep
from most.training import METRICS, build_stage, build_trainer, run_files, stage1_file

register()


def train(config: Config, folder: Path, told: dict[str, Any]) -> float:
    """Train the stages that are asked for, one after the other; return the PQ that the last one reached.

    Writes ``checkpoints/`` and, when all is done, ``metrics.json``, the figures of the last stage's last weights, to
    ``folder``. ``told`` is logged beside the configuration.
    """
    if config.trainer.threads:
        torch.set_num_threads(config.trainer.threads)
    data = SweepDataModule(config.dataset, config.augment, config.extent, config.seed)
    names = stages_to_run(config, data.reader, folder)
    settings: Any = OmegaConf.to_container(OmegaConf.structured(config))
    try:
        logger = config.logger.build(folder, config.name, settings | told)
        for name in names:
            stage = run_stage(name, config, data, folder, logger, config.resume if name == names[0] else None)
        log_artifacts(logger, run_files(config, folder))
    finally:
        wandb.finish()  # the next job of a sweep runs in this process, and is another run
    return float(stage.report["panoptic"]["pq"])


def run_stage(
    name: str, config: Config, data: SweepDataModule, folder: Path, logger: Logger | bool, resume: str | None
) -> Stage:
    """Train one stage from its beginning, or from a checkpoint, to its end."""
    L.seed_everything(config.seed, workers=True)
    stage = build_stage(name, config, data, Path(resume or stage1_file(config, Path(config.stage1 or folder))))
    trainer = build_trainer(config, stage, folder, logger)
    trainer.fit(stage, datamodule=data, ckpt_path=resume, weights_only=True)
    if stage.report.get("epochs") != stage.epochs:
        trainer.validate(stage, datamodule=data, verbose=False)
    if trainer.is_global_zero and name == config.stage.run[-1]:
        write_report(folder / METRICS, stage.report)
    return stage


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="train")
def main(config: DictConfig) -> Any:
    """Compose, check, train; a sweeper that optimises gets the PQ."""
    job = HydraConfig.get()
    folder = Path(job.runtime.output_dir)
    told = {"choices": chosen(job.runtime.choices), "overrides": by_key(job.overrides.task)}
    if job.mode != RunMode.MULTIRUN:
        run(lambda: train(typed(config), folder, told))
        return None
    return as_job(lambda: train(in_sweep(typed(config), job.sweep.dir, folder), folder, told))


if __name__ == "__main__":
    start(main)
