"""What each stage costs: ``python -m most.oracle checkpoint=FILE split=val out=oracle.json``."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import hydra
import torch
from omegaconf import DictConfig
from torch.utils.data import DataLoader
from tqdm import tqdm

from most.assembly import check_taxonomy, load_trained
from most.config import conf_dir, register, store_root, typed
from most.datasets.dataset import WindowDataset
from most.datasets.instances import InstanceTables
from most.datasets.reader import Reader
from most.entry import run, start
from most.errors import DataError
from most.inference import Inference
from most.ladder import Ladder, ModelLook, NoModel, format_ladder
from most.ladder.looks import Look
from most.metrics.report import write_report


@dataclass
class OracleConfig:
    """What ``most.oracle`` is told."""

    checkpoint: str | None = None  # null: no model, the truth is everywhere
    out: str = "oracle.json"
    split: str = "val"
    dataset: Any = None
    extent: Any = None  # the truth's extents
    tracker: Any = None
    grid: Any = None  # of the voxels; a checkpoint has its own
    inference: Inference = field(default_factory=Inference)  # a checkpoint has its own


register()
store_root("oracle", OracleConfig)


def look_of(config: OracleConfig, reader: Reader) -> tuple[Look, int]:
    """Return what looks at the sweeps, and how many previous ones it needs."""
    if config.checkpoint is None:
        return NoModel(config.grid, config.inference, reader.taxonomy.num_classes), 0
    trained = load_trained(Path(config.checkpoint))
    check_taxonomy(trained.taxonomy, reader.taxonomy)
    return ModelLook(trained.predictor), trained.sweeps


@torch.inference_mode()
def oracle(config: OracleConfig) -> None:
    """Write every rung's report to ``out`` and print their main figures."""
    dataset, reader = config.dataset, config.dataset.reader()
    look, previous = look_of(config, reader)
    frames = reader.frames(config.split)
    tables = InstanceTables(reader, config.extent, dataset.tables)
    for sequence in reader.sequences(config.split):
        if not reader.has_labels(sequence):
            raise DataError(f"split={config.split}: expected labels, found none of {sequence}; choose another split")
        tables.table(sequence)
    windows = WindowDataset(reader, frames, previous, instances=tables)
    loader = DataLoader(windows, dataset.batch_size, num_workers=dataset.workers, collate_fn=list)
    ladder = Ladder(reader, look, config.tracker)
    for samples in tqdm(loader, "oracle", unit="batch"):
        ladder.add(samples)
    rungs = ladder.report()
    write_report(Path(config.out), {"scans": len(frames), "checkpoint": config.checkpoint, "rungs": rungs})
    print(format_ladder(rungs))


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="oracle")
def main(config: DictConfig) -> None:
    """Compose, check, climb."""
    run(lambda: oracle(typed(config)))


if __name__ == "__main__":
    start(main)
