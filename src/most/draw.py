"""Draw a predicted sweep: ``python -m most.draw predictions=FOLDER sequence=08 index=4 out=sweep.png``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hydra
from omegaconf import MISSING, DictConfig

from most.config import conf_dir, register, store_root, typed
from most.datasets.dataset import WindowDataset
from most.datasets.instances import InstanceTables
from most.datasets.reader import Frame
from most.datasets.semantickitti import SemanticKITTI
from most.entry import run
from most.modal.extent import TrackMax
from most.predicting import read_prediction
from most.viz.bev import save
from most.viz.callback import draw_prediction


@dataclass
class DrawConfig:
    """What ``most.draw`` is told."""

    predictions: str = MISSING  # a folder that most.predict wrote
    sequence: str = MISSING
    index: int = 0
    out: str = "sweep.png"
    dataset: Any = None


register()
store_root("draw", DrawConfig)


def draw(config: DrawConfig) -> None:
    """Draw prediction, truth (where there are labels) and errors of one sweep in bird's-eye view."""
    reader = SemanticKITTI(config.dataset.root, config.dataset.splits)
    frame = Frame(config.sequence, config.index)
    prediction = read_prediction(reader.prediction_path(Path(config.predictions), frame), reader.taxonomy)
    instances = InstanceTables(reader, TrackMax(), config.dataset.tables)
    sample = WindowDataset(reader, [frame], previous=0, instances=instances)[0]
    save(draw_prediction(sample, prediction, reader.taxonomy), Path(config.out))


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="draw")
def main(config: DictConfig) -> None:
    """Compose, check, draw."""
    run(lambda: draw(typed(config)))


if __name__ == "__main__":
    main()
