"""Lay out or publish the W&B workspace of trainings: ``python -m most.dashboard out=dashboard.json``."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import hydra
from omegaconf import DictConfig

from most.config import conf_dir, register, store_root, typed
from most.datasets.taxonomy import Taxonomy
from most.entry import run, start
from most.errors import ConfigError
from most.files import atomic_write
from most.logs import check_key
from most.viz.dashboard import Section, describe, layout, workspace


@dataclass
class DashboardConfig:
    """What ``most.dashboard`` is told."""

    out: str = "dashboard.json"
    taxonomy: str = "semantickitti"  # whose classes have curves: its things
    pictures: int = 2  # as logger.pictures of the trainings
    publish: bool = False  # needs an entity, and the key of its account
    entity: str | None = None  # user or team
    project: str = "most"
    name: str = "MOST"  # of the workspace

    def __post_init__(self) -> None:
        if self.pictures < 0:
            raise ConfigError(f"pictures: expected a number >= 0, found {self.pictures}")
        if self.publish and not self.entity:
            raise ConfigError("publish: expected the user or team to publish for, found none; say entity=NAME")


register()
store_root("dashboard", DashboardConfig)


def dashboard(config: DashboardConfig) -> None:
    """Write the layout to ``out``; where asked to, make the workspace of it."""
    if config.publish:
        check_key("publish", "leave it out")
    taxonomy = Taxonomy.load(config.taxonomy)
    things = [taxonomy.class_names[thing] for thing in taxonomy.things]
    sections = layout(things, config.pictures)
    with atomic_write(Path(config.out), "w") as file:
        file.write(json.dumps(describe(sections), indent=2) + "\n")
    print(f"{config.out}: {sum(len(section.panels) for section in sections)} panels in {len(sections)} sections")
    if config.publish:
        print(f"published: {publish(config, sections)}")


def publish(config: DashboardConfig, sections: Sequence[Section]) -> str:
    """Make the workspace in W&B; return its address. What W&B or the network refuses is a ConfigError."""
    made = workspace(sections, str(config.entity), config.project, config.name)
    try:
        return str(made.save().url)
    except Exception as error:  # each version of W&B's packages has its own
        raise ConfigError(
            f"publish: expected W&B to take a workspace for {config.entity}/{config.project}, found "
            f"{type(error).__name__}: {error}; see that key, names and network are right, and repeat the command"
        ) from error


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="dashboard")
def main(config: DictConfig) -> None:
    """Compose, check, lay out."""
    run(lambda: dashboard(typed(config)))


if __name__ == "__main__":
    start(main)
