"""Simulate a dataset: ``python -m most.simulate simulation=demo out=data/simulated``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hydra
from hydra.core.config_store import ConfigStore
from omegaconf import DictConfig

from most.config import conf_dir, typed
from most.entry import run, start
from most.simulation import SimulationSettings, simulate


@dataclass
class SimulateConfig:
    """Everything ``most.simulate`` is told."""

    simulation: Any = None
    out: str = "data/simulated"  # root of the tree


ConfigStore.instance().store(name="simulate_schema", node=SimulateConfig)
ConfigStore.instance().store(group="simulation", name="simulation_schema", node=SimulationSettings)


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="simulate")
def main(config: DictConfig) -> None:
    """Compose, check, simulate."""
    run(lambda: _simulate(typed(config)))


def _simulate(config: SimulateConfig) -> None:
    simulate(config.simulation, Path(config.out))


if __name__ == "__main__":
    start(main)
