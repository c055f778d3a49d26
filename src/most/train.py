"""Train MOST: ``python -m most.train +experiment=semkitti_max``."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

import hydra
import torch
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from most.checks import stages_to_run
from most.config import Config, conf_dir, register, typed
from most.datasets.datamodule import SweepDataModule
from most.entry import run, start
from most.logs import ended
from most.run_folder import begun, check_shared, chosen, gone_if_refused
from most.stages.artifacts import log_artifacts
from most.sweeps import as_job, by_key, in_sweep
from most.training import resumed_file, run_files, run_stage

Begin = Callable[[bool], AbstractContextManager[None]]

register()


def train(config: Config, folder: Path, told: dict[str, Any], begin: Begin) -> float:
    """Train the stages that are asked for, one after the other; return the PQ that the last one reached.

    Writes ``checkpoints/`` and, when all is done, ``metrics.json``, the figures of the last stage's last weights, to
    ``folder``. ``told`` is logged beside the configuration; ``begin`` is entered when all is accepted, and told
    whether the run goes on.
    """
    if config.trainer.threads:
        torch.set_num_threads(config.trainer.threads)
    data = SweepDataModule(config.dataset, config.augment, config.extent, config.seed)
    names = stages_to_run(config, data.reader, folder)
    settings: Any = OmegaConf.to_container(OmegaConf.structured(config))
    resume = str(resumed_file(Path(config.resume))) if config.resume else None
    with begin(resume is not None), ended():
        logger = config.logger.build(folder, config.name, settings | told)
        for name in names:
            stage = run_stage(name, config, data, folder, logger, resume if name == names[0] else None)
        log_artifacts(logger, run_files(config, folder))
    return float(stage.report["panoptic"]["pq"])


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="train")
def main(config: DictConfig) -> Any:
    """Compose, check, train; a sweeper that optimises gets the PQ."""
    job = HydraConfig.get()
    folder = Path(job.runtime.output_dir)
    told = {"choices": chosen(job.runtime.choices), "overrides": by_key(job.overrides.task)}
    begin = partial(begun, folder, config)
    if job.mode == RunMode.MULTIRUN:
        return as_job(lambda: train(in_sweep(typed(config), job.sweep.dir, folder), folder, told, begin))

    def alone() -> None:
        with gone_if_refused(folder):
            check_shared(job.overrides.hydra)
            train(typed(config), folder, told, begin)

    return run(alone)


if __name__ == "__main__":
    start(main)
