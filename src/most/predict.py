"""Label a split with a trained model: ``python -m most.predict checkpoint=FILE split=val out=FOLDER``."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import hydra
import torch
from omegaconf import MISSING, DictConfig
from torch.utils.data import DataLoader

from most.assembly import check_taxonomy, load_trained
from most.config import conf_dir, register, store_root, typed
from most.datasets.dataset import WindowDataset
from most.entry import run, start
from most.errors import ConfigError
from most.membership import Nearest
from most.predicting import claim_folder, unfinished, write_predictions


@dataclass
class PredictConfig:
    """What ``most.predict`` is told."""

    checkpoint: str = MISSING
    out: str = MISSING
    split: str = "val"
    dataset: Any = None
    nearest: bool = False  # leave stage 2 out: points go to the nearest centre
    device: str = "auto"  # auto: a GPU where there is one

    def __post_init__(self) -> None:
        self.chosen_device()

    def chosen_device(self) -> torch.device:
        """Return where to predict; one that is not there is a ConfigError."""
        there = torch.cuda.is_available()
        if self.device not in ("auto", "cpu", *(["cuda"] if there else [])):
            raise ConfigError(f"device: expected auto, cpu, or cuda where there is a GPU, found {self.device}")
        return torch.device("cuda" if there and self.device != "cpu" else "cpu")


register()
store_root("predict", PredictConfig)


def predict(config: PredictConfig) -> None:
    """Write the dataset's official prediction files, and detections beside them, to the folder ``out``."""
    checkpoint, out, dataset = Path(config.checkpoint), Path(config.out), config.dataset
    trained = load_trained(checkpoint)
    predictor = replace(trained.predictor, membership=Nearest()) if config.nearest else trained.predictor
    reader = dataset.reader()
    check_taxonomy(trained.taxonomy, reader.taxonomy)
    frames = reader.frames(config.split)
    claim_folder(out, checkpoint, reader, config.split, "nearest" if config.nearest else "trained")
    frames = unfinished(reader, frames, out)
    windows = WindowDataset(reader, frames, trained.sweeps)
    loader = DataLoader(windows, dataset.batch_size, num_workers=dataset.workers, collate_fn=list)
    write_predictions(predictor, loader, reader, out, len(frames), config.chosen_device())


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="predict")
def main(config: DictConfig) -> None:
    """Compose, check, predict."""
    run(lambda: predict(typed(config)))


if __name__ == "__main__":
    start(main)
