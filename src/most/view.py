"""Write a recording for the rerun viewer: ``python -m most.view predictions=FOLDER sequence=08 out=scene.rrd``."""

import importlib.util
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hydra
from omegaconf import MISSING, DictConfig

from most.config import conf_dir, register, store_root, typed
from most.entry import run, start
from most.errors import ConfigError
from most.files import atomic_path


@dataclass
class ViewConfig:
    """What ``most.view`` is told."""

    predictions: str = MISSING  # holds the dataset's official prediction files, ours or anyone's
    sequence: str = MISSING
    out: str = "scene.rrd"
    first: int = 0  # number of the first scan
    last: int | None = None  # of the last one; null: to the end
    dataset: Any = None

    def __post_init__(self) -> None:
        if self.first < 0:
            raise ConfigError(f"first: expected the number of a scan, found {self.first}")
        if self.last is not None and self.last < self.first:
            raise ConfigError(f"last: expected a number from first={self.first} on, found {self.last}")


register()
store_root("view", ViewConfig)


def view(config: ViewConfig) -> None:
    """Write prediction and, where there are labels, truth of a range of scans to ``out``."""
    if importlib.util.find_spec("rerun") is None:
        raise ConfigError("most.view: expected the extra viz, found no rerun; pip install 'most-lidar[viz]'")
    from most.viz.scene import predicted_frames, write_scene

    reader, folder = config.dataset.reader(), Path(config.predictions)
    frames = predicted_frames(reader, config.sequence, folder, config.first, config.last)
    with atomic_path(Path(config.out)) as part:
        write_scene(part, reader, frames, folder)


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="view")
def main(config: DictConfig) -> None:
    """Compose, check, write."""
    run(lambda: view(typed(config)))


if __name__ == "__main__":
    start(main)
