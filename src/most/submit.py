"""Package predictions for a benchmark: ``python -m most.submit predictions=FOLDER split=test out=FILE.zip``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hydra
from omegaconf import MISSING, DictConfig

from most.config import conf_dir, register, store_root, typed
from most.entry import run, start
from most.submission import write_submission


@dataclass
class SubmitConfig:
    """What ``most.submit`` is told."""

    predictions: str = MISSING  # holds the dataset's official prediction files, ours or anyone's
    out: str = "submission.zip"
    split: str = "test"
    dataset: Any = None


register()
store_root("submit", SubmitConfig)


def submit(config: SubmitConfig) -> None:
    """Check every scan's prediction, then write the archive ``out``; the scans are needed, to count their points."""
    reader, out = config.dataset.reader(), Path(config.out)
    write_submission(reader, config.split, Path(config.predictions), out)
    print(f"{out}: ready to be uploaded")


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="submit")
def main(config: DictConfig) -> None:
    """Compose, check, package."""
    run(lambda: submit(typed(config)))


if __name__ == "__main__":
    start(main)
