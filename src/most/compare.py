"""Set reports side by side: ``python -m most.compare 'reports={nearest: a.json, full: b.json}'``."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hydra
from omegaconf import MISSING, DictConfig

from most.config import conf_dir, register, store_root, typed
from most.entry import run, start
from most.errors import ConfigError
from most.metrics.report import read_report
from most.reports.comparison import format_differences, format_figures


@dataclass
class CompareConfig:
    """What ``most.compare`` is told."""

    reports: Any = MISSING  # a name for each file that most.evaluate or most.train wrote

    def __post_init__(self) -> None:
        if not isinstance(self.reports, Mapping) or not self.reports:
            raise ConfigError(
                f"reports: expected names and files, such as 'reports={{a: a.json, b: b.json}}', found {self.reports}"
            )


register()
store_root("compare", CompareConfig)


def compare(config: CompareConfig) -> None:
    """Print a line for each report, and below how much higher the others are than the first."""
    reports = {str(name): read_report(Path(str(path))) for name, path in config.reports.items()}
    print(format_figures(reports))
    if len(reports) > 1:
        print(f"\n{format_differences(reports)}")


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="compare")
def main(config: DictConfig) -> None:
    """Compose, check, compare."""
    run(lambda: compare(typed(config)))


if __name__ == "__main__":
    start(main)
