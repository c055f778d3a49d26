"""A run's folder holds what the run was told once that is accepted; a refused run leaves all as it was."""

from pathlib import Path

import pytest
import yaml
from hydra import compose, initialize_config_dir
from hydra.core.hydra_config import HydraConfig

from most.config import conf_dir, register
from most.errors import ConfigError
from most.run_folder import check_shared, gone_if_refused, write_down
from most.sweeps import Job


def refuse(folder: Path) -> None:
    with pytest.raises(ConfigError, match="no such extent"), gone_if_refused(folder):
        raise ConfigError("no such extent")


def test_what_a_run_was_told_is_written_by_hydras_names(tmp_path, monkeypatch):
    register()
    with initialize_config_dir(str(conf_dir()), version_base=None):
        job = Job([], compose("train", ["extent=shrink_wrap", "seed=7"], return_hydra_config=True))
    monkeypatch.setattr(HydraConfig.instance(), "cfg", None)
    HydraConfig.instance().set_config(job.composed)
    write_down(tmp_path, job.settings())
    written = {path.name: yaml.safe_load(path.read_text()) for path in (tmp_path / ".hydra").iterdir()}
    assert sorted(written) == ["config.yaml", "hydra.yaml", "overrides.yaml"]
    assert (written["config.yaml"]["seed"], "hydra" in written["config.yaml"]) == (7, False)
    assert written["hydra.yaml"]["hydra"]["runtime"]["choices"]["extent"] == "shrink_wrap"
    assert written["overrides.yaml"] == ["extent=shrink_wrap", "seed=7"]


def test_a_refused_run_leaves_no_folder_of_its_own(tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    (run / "train.log").touch()
    refuse(run)
    assert not run.exists()
    refuse(run)  # not even there


@pytest.mark.parametrize("left", ["metrics.json", "train.log"])
def test_a_refused_run_leaves_what_is_another_runs(tmp_path, left):
    (tmp_path / left).write_text("said before")
    (tmp_path / "empty.log").touch()
    refuse(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(["empty.log", left])


def test_a_run_that_ends_well_keeps_its_folder(tmp_path):
    with gone_if_refused(tmp_path / "run"):
        (tmp_path / "run").mkdir()
    assert (tmp_path / "run").is_dir()


@pytest.mark.parametrize("name", ["WORLD_SIZE", "SLURM_NTASKS"])
def test_processes_that_others_start_are_told_the_folder_that_they_share(name, monkeypatch):
    for each in ("WORLD_SIZE", "SLURM_NTASKS", "SLURM_JOB_NAME"):
        monkeypatch.delenv(each, raising=False)
    check_shared([])
    monkeypatch.setenv(name, "1")
    check_shared([])
    monkeypatch.setenv(name, "2")
    check_shared(["hydra.job.name=a", "hydra.run.dir=runs/a"])
    with pytest.raises(ConfigError, match=rf"hydra\.run\.dir: expected the folder .* {name}=2; add hydra\.run\.dir"):
        check_shared(["hydra.job.name=a"])


def test_an_interactive_job_of_slurm_is_one_process(monkeypatch):
    monkeypatch.delenv("WORLD_SIZE", raising=False)
    monkeypatch.setenv("SLURM_NTASKS", "4")
    monkeypatch.setenv("SLURM_JOB_NAME", "interactive")
    check_shared([])
