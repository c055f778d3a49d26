"""Draw a predicted sweep: ``python -m most.draw predictions=FOLDER sequence=08 index=4 out=sweep.png``."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import hydra
from omegaconf import MISSING, DictConfig

from most.config import conf_dir, register, store_root, typed
from most.datasets.dataset import WindowDataset
from most.datasets.reader import Frame, Reader
from most.entry import run, start
from most.geometry.similarity import Similarity
from most.modal.build import LabelRules, build_table
from most.modal.extent import ShrinkWrap
from most.predictions import read_prediction
from most.structures import Instances
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
    reader = config.dataset.reader()
    frame = Frame(config.sequence, config.index)
    prediction = read_prediction(reader, reader.prediction_path(Path(config.predictions), frame))
    sample = WindowDataset(reader, [frame], previous=0, instances=partial(instances_of_one, reader))[0]
    save(draw_prediction(sample, prediction, reader.taxonomy), Path(config.out))


def instances_of_one(reader: Reader, frame: Frame, change: Similarity) -> Instances:
    """The instances of one sweep as it shows them: shrink-wrapped, motion unknown; no table of its sequence is made."""
    taxonomy = reader.taxonomy
    rules = LabelRules(taxonomy.to_training, taxonomy.is_thing, taxonomy.instance_of)
    table = build_table([reader.sweep(frame)], rules)
    return table.instances(frame.index, ShrinkWrap(), change.linear, change.translation)


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="draw")
def main(config: DictConfig) -> None:
    """Compose, check, draw."""
    run(lambda: draw(typed(config)))


if __name__ == "__main__":
    start(main)
