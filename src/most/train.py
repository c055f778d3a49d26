"""Train MOST: ``python -m most.train +experiment=semkitti_max``."""

from pathlib import Path

import hydra
import lightning as L
import torch
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from most.config import Config, conf_dir, register, typed
from most.datasets.datamodule import SemanticKITTIDataModule
from most.entry import run
from most.metrics.report import write_report
from most.training import build_stage, build_trainer

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
    write_report(folder / "metrics.json", stage.report)


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="train")
def main(config: DictConfig) -> None:
    """Compose, check, train."""
    run(lambda: train(typed(config), Path(HydraConfig.get().runtime.output_dir)))


if __name__ == "__main__":
    main()
