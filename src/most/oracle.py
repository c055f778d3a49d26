"""What each stage costs: ``python -m most.oracle checkpoint=FILE split=val out=oracle.json``."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import hydra
import torch
from omegaconf import DictConfig

from most.assembly import Trained, check_taxonomy, load_trained
from most.config import conf_dir, register, store_root, to_plain, typed
from most.datasets.instances import InstanceTables, check_extent
from most.datasets.taxonomy import Taxonomy
from most.device import chosen_device
from most.entry import refuse_idle, run, start
from most.inference import Inference
from most.ladder import Ladder, Look, ModelLook, NoModel, check_labels, climb, format_ladder
from most.metrics.report import write_report
from most.modal.extent import TrackMax


@dataclass
class OracleConfig:
    """What ``most.oracle`` is told."""

    checkpoint: str | None = None  # null: no model, the truth is everywhere
    out: str = "oracle.json"
    split: str = "val"
    dataset: Any = None
    extent: Any = None  # the truth's extents; null: those that the checkpoint was trained for, track_max without one
    tracker: Any = None
    grid: Any = None  # of the voxels; a checkpoint has its own
    inference: Inference = field(default_factory=Inference)  # a checkpoint has its own
    device: str = "auto"  # auto: a GPU where there is one

    def __post_init__(self) -> None:
        chosen_device(self.device)


register()
store_root("oracle", OracleConfig)


def look_of(
    config: OracleConfig, trained: Trained | None, taxonomy: Taxonomy, device: torch.device
) -> tuple[Look, int]:
    """Return what looks at the sweeps, and how many previous ones it needs."""
    if trained is None:
        return NoModel(config.grid, config.inference, taxonomy.num_classes), 0
    check_taxonomy(trained.taxonomy, taxonomy)
    for module in trained.predictor.modules().values():
        module.to(device)
    return ModelLook(trained.predictor, trained.likely_targets()), trained.sweeps


def oracle(config: OracleConfig) -> None:
    """Write every row's report to ``out`` and print the main figures."""
    if config.checkpoint is not None:
        refuse_idle(("grid", "inference"), "with a checkpoint, which has its own")
    dataset, reader = config.dataset, config.dataset.reader()
    device = chosen_device(config.device)
    trained = None if config.checkpoint is None else load_trained(Path(config.checkpoint))
    look, previous = look_of(config, trained, reader.taxonomy, device)
    extent = config.extent or (trained.likely_extent() if trained else TrackMax())
    check_labels(reader, config.split)
    check_extent(extent, reader, config.split)
    tables = InstanceTables(reader, extent, dataset.tables)
    ladder = Ladder(reader.taxonomy, tables, look, config.tracker, device)
    climb(ladder, reader, config.split, previous, ahead=dataset.workers > 0)
    rows = ladder.report()
    write_report(
        Path(config.out), {"checkpoint": config.checkpoint, "extent": to_plain("extent", extent), "rows": rows}
    )
    print(format_ladder(rows))


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="oracle")
def main(config: DictConfig) -> None:
    """Compose, check, climb."""
    run(lambda: oracle(typed(config)))


if __name__ == "__main__":
    start(main)
