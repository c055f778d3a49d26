"""The paper's tables of finished runs: ``python -m most.report runs=FOLDER out=FOLDER``."""

from dataclasses import dataclass
from pathlib import Path

import hydra
from omegaconf import MISSING, DictConfig

from most.config import conf_dir, register, store_root, typed
from most.entry import run, start
from most.errors import ConfigError
from most.reports.write import write_reports


@dataclass
class ReportConfig:
    """What ``most.report`` is told."""

    runs: str = MISSING  # holds runs of most.train, or sweeps of them, at any depth
    out: str = "report"
    baseline: str | None = None  # a row of Table I or II: an extent, offset_regression, ..., or a membership
    draws: int = 10_000  # of the bootstrap
    seed: int = 1  # of its draws

    def __post_init__(self) -> None:
        if self.draws < 100:
            raise ConfigError(f"draws: expected at least 100, found {self.draws}")
        if self.seed < 0:
            raise ConfigError(f"seed: expected a number >= 0, found {self.seed}")


register()
store_root("report", ReportConfig)


def report(config: ReportConfig) -> None:
    """Write tables, plots and a page to ``out``; nothing but the runs' files is read."""
    runs, out = Path(config.runs), Path(config.out)
    for path in write_reports(runs, out, config.baseline, config.draws, config.seed):
        print(path)


@hydra.main(version_base=None, config_path=str(conf_dir()), config_name="report")
def main(config: DictConfig) -> None:
    """Compose, check, report."""
    run(lambda: report(typed(config)))


if __name__ == "__main__":
    start(main)
