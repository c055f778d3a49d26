"""Score a folder of predictions: ``python -m most.evaluate predictions=FOLDER split=val out=metrics.json``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hydra
from omegaconf import MISSING, DictConfig

from most.config import conf_dir, register, store_root, typed
from most.entry import run, start
from most.metrics.folders import evaluate_folder
from most.metrics.paper_tables import paper_rows, why_none
from most.metrics.report import format_row, format_table, write_report
from most.predicting import predicted_by


@dataclass
class EvaluateConfig:
    """What ``most.evaluate`` is told."""

    predictions: str = MISSING  # holds the dataset's official prediction files, ours or anyone's
    out: str = "metrics.json"
    split: str = "val"
    dataset: Any = None


register()
store_root("evaluate", EvaluateConfig)


def evaluate(config: EvaluateConfig) -> None:
    """Write the report to ``out`` and print its tables; labels are needed of the dataset, scans are not."""
    reader = config.dataset.reader()
    frames = reader.labelled_frames(config.split)
    predictions = Path(config.predictions)
    report = evaluate_folder(reader, frames, predictions) | predicted_by(predictions)
    write_report(Path(config.out), report)
    taxonomy = reader.taxonomy
    print(format_table(report["panoptic"], [taxonomy.class_names[thing] for thing in taxonomy.things]))
    for text in (*map(format_row, paper_rows(report)), *why_none(report)):
        print(f"\n{text}")


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="evaluate")
def main(config: DictConfig) -> None:
    """Compose, check, score."""
    run(lambda: evaluate(typed(config)))


if __name__ == "__main__":
    start(main)
