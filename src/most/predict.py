"""Label a split with a trained model: ``python -m most.predict checkpoint=FILE split=val out=FOLDER``."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import hydra
from omegaconf import MISSING, DictConfig

from most.assembly import exchange_membership, load_trained
from most.config import conf_dir, register, store_root, typed
from most.datasets.scan_folder import ScanFolder, ScanFolderSettings
from most.device import chosen_device
from most.entry import refuse_idle, run, start
from most.predicting import describe_model, predict_split
from most.predicting_scans import predict_scans
from most.streaming import PanopticTracker


@dataclass
class PredictConfig:
    """What ``most.predict`` is told."""

    checkpoint: str = MISSING
    out: str = MISSING
    split: str = "val"
    dataset: Any = None
    input: str | None = None  # a folder of scans that belongs to no dataset: it is labelled in the dataset's stead
    scans: ScanFolderSettings = field(default_factory=ScanFolderSettings)  # how those are read
    tracker: Any = None
    membership: Any = None  # another than the checkpoint's: stage 2 is left out
    device: str = "auto"  # auto: a GPU where there is one

    def __post_init__(self) -> None:
        chosen_device(self.device)


register()
store_root("predict", PredictConfig)


def predict(config: PredictConfig) -> None:
    """Write labels with the numbers of tracks, and detections beside them, to the folder ``out``."""
    if config.input is None:
        refuse_idle(("scans",), "without input=FOLDER, whose scans they are about")
    else:
        refuse_idle(("dataset", "split"), "with input, whose scans belong to no dataset")
    checkpoint = Path(config.checkpoint)
    trained = load_trained(checkpoint)
    if config.membership is not None:
        trained = exchange_membership(trained, config.membership)
    model = PanopticTracker(trained, config.tracker, chosen_device(config.device))
    described = describe_model(checkpoint, config.membership, config.tracker)
    if config.input is None:
        reader, ahead = config.dataset.reader(), config.dataset.workers > 0
        predict_split(model, described, reader, config.split, Path(config.out), ahead)
    else:
        scans = ScanFolder(config.input, config.scans)
        predict_scans(model, described, scans, Path(config.out))


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="predict")
def main(config: DictConfig) -> None:
    """Compose, check, predict."""
    run(lambda: predict(typed(config)), goes_on=True)


if __name__ == "__main__":
    start(main)
