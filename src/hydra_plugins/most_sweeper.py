"""Hydra's sweeper for ``python -m most.train -m``: it knows when a job is refused, finished, or has failed.

Hydra imports every module of ``hydra_plugins`` whenever it starts: heavy imports wait until there is a sweep.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.config_store import ConfigStore
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf


@dataclass
class MostSweeperConf:
    """The sweeper ``most``; all combinations of the overrides, as Hydra's own."""

    _target_: str = "hydra_plugins.most_sweeper.MostSweeper"
    max_batch_size: int | None = None  # no job starts before all are checked, so there is one batch
    params: dict[str, str] | None = None  # overrides that every sweep has


ConfigStore.instance().store(group="hydra/sweeper", name="most", node=MostSweeperConf, provider="most")


class MostSweeper(BasicSweeper):
    """Checks all jobs before any starts, leaves out those that are finished, and reports those that failed."""

    def sweep(self, arguments: list[str]) -> Any:
        """Run what is missing of a sweep."""
        from most.sweeps import check_jobs, report, stopping

        assert self.config is not None  # Hydra has set it up
        assert self.launcher is not None
        folder = Path(self.config.hydra.sweep.dir)
        jobs = self._jobs(arguments)
        check_jobs(jobs)
        missing = [job for job in jobs if not job.finished]
        print(f"{folder}: {len(jobs)} jobs, {len(jobs) - len(missing)} of them finished before", flush=True)
        if not missing:
            return []
        folder.mkdir(parents=True, exist_ok=True)
        OmegaConf.save(self.config, folder / "multirun.yaml")
        with stopping(missing):
            ends = self.launcher.launch([job.arguments for job in missing], initial_job_idx=0)
        report(missing, [end._return_value for end in ends])
        return ends

    def _jobs(self, arguments: list[str]) -> list[Any]:
        """All combinations, composed; each gets a folder that its overrides name."""
        from most.sweeps import Job, job_name

        assert self.config is not None
        assert self.hydra_context is not None
        loader = self.hydra_context.config_loader
        overrides = OverridesParser.create(config_loader=loader).parse_overrides([*self._parse_config(), *arguments])
        jobs = []
        for combination in self.split_arguments(overrides, None)[0]:
            told = [*combination, f"hydra.sweep.subdir='{job_name(combination)}'"]
            jobs.append(Job(told, loader.load_sweep_config(self.config, told)))
        return jobs
