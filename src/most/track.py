"""Give predicted instances identities over time: ``python -m most.track predictions=FOLDER out=FOLDER``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hydra
from omegaconf import MISSING, DictConfig

from most.config import conf_dir, register, store_root, typed
from most.entry import run, start
from most.relabelling import write_tracks


@dataclass
class TrackConfig:
    """What ``most.track`` is told."""

    predictions: str = MISSING  # holds the dataset's official prediction files, ours or anyone's
    out: str = MISSING
    split: str = "val"
    dataset: Any = None
    tracker: Any = None


register()
store_root("track", TrackConfig)


def track(config: TrackConfig) -> None:
    """Write the same predictions to the folder ``out``, numbered by tracks; scans, poses and times are needed."""
    predictions, out = Path(config.predictions), Path(config.out)
    write_tracks(config.dataset.reader(), config.split, predictions, out, config.tracker)


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="track")
def main(config: DictConfig) -> None:
    """Compose, check, track."""
    run(lambda: track(typed(config)), goes_on=True)


if __name__ == "__main__":
    start(main)
