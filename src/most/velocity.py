"""What predicted velocities are worth to tracking: ``python -m most.velocity velocity=TRACKS nearest=TRACKS``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hydra
from omegaconf import MISSING, DictConfig

from most.config import conf_dir, register, store_root, typed
from most.datasets.instances import InstanceTables
from most.entry import run, start
from most.metrics.report import write_report
from most.metrics.velocity_gain import velocity_gain
from most.metrics.velocity_table import format_velocity_gain
from most.modal.extent import TrackMax


@dataclass
class VelocityConfig:
    """What ``most.velocity`` is told."""

    velocity: str = MISSING  # what most.track made of predictions with detections beside them
    nearest: str = MISSING  # and of the same with tracker.motion=nearest
    out: str = "velocity.json"
    split: str = "val"
    dataset: Any = None


register()
store_root("velocity", VelocityConfig)


def velocity(config: VelocityConfig) -> None:
    """Write the report to ``out`` and print its tables; scans and labels are needed."""
    dataset = config.dataset
    reader = dataset.reader()
    instances = InstanceTables(reader, TrackMax(), dataset.tables)  # of extents nothing is read
    frames = reader.labelled_frames(config.split)
    report = velocity_gain(reader, frames, instances, Path(config.velocity), Path(config.nearest))
    write_report(Path(config.out), report)
    print(format_velocity_gain(report))


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="velocity")
def main(config: DictConfig) -> None:
    """Compose, check, compare."""
    run(lambda: velocity(typed(config)))


if __name__ == "__main__":
    start(main)
