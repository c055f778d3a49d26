"""A run's folder holds what the run was told once that is accepted; a refused run leaves all as it was."""

import multiprocessing
import signal
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

import pytest
import yaml
from hydra import compose, initialize_config_dir
from hydra.core.hydra_config import HydraConfig
from lightning.pytorch.utilities import rank_zero_only
from omegaconf import DictConfig, OmegaConf

from most.config import conf_dir, register
from most.errors import ConfigError
from most.run_folder import begun, check_shared, gone_if_refused, held, write_down
from most.sweeps import Job


def refuse(folder: Path) -> None:
    with pytest.raises(ConfigError, match="no such extent"), gone_if_refused(folder):
        raise ConfigError("no such extent")


@pytest.fixture
def told(monkeypatch):
    """Tell Hydra overrides in the current folder; return the settings that it makes of them."""
    register()

    def tell(*overrides: str) -> DictConfig:
        with initialize_config_dir(str(conf_dir()), version_base=None):
            job = Job([], compose("train", [*overrides], return_hydra_config=True))
        OmegaConf.set_readonly(job.composed.hydra, False)
        job.composed.hydra.runtime.cwd = str(Path.cwd())
        monkeypatch.setattr(HydraConfig.instance(), "cfg", None)
        HydraConfig.instance().set_config(job.composed)
        return job.settings()

    return tell


def test_what_a_run_was_told_is_written_by_hydras_names(tmp_path, told):
    write_down(tmp_path, told("extent=shrink_wrap", "seed=7"))
    written = {path.name: yaml.safe_load(path.read_text()) for path in (tmp_path / ".hydra").iterdir()}
    assert sorted(written) == ["config.yaml", "hydra.yaml", "overrides.yaml"]
    assert (written["config.yaml"]["seed"], "hydra" in written["config.yaml"]) == (7, False)
    assert written["hydra.yaml"]["hydra"]["runtime"]["choices"]["extent"] == "shrink_wrap"
    assert written["overrides.yaml"] == ["extent=shrink_wrap", "seed=7"]


FORK = multiprocessing.get_context("fork")
STAGE_2 = ("stage=membership", "stage1=runs/a", "seed=3")


def go_on(folder: Path, settings: DictConfig) -> None:
    with begun(folder, settings, goes_on=True):
        pass


@pytest.mark.parametrize(
    ("now", "message"),
    [
        ((*STAGE_2[::2],), "stage1 = runs/a, found None"),
        ((*STAGE_2, "stage1=runs/b"), "stage1 = runs/a, found runs/b"),
        ((*STAGE_2, "stage.hand_over=last"), "stage.hand_over = best, found last"),
        ((*STAGE_2, "extent=shrink_wrap", "backbone=residual_unet"), "backbone = asymmetric_unet, found residual_unet"),
    ],
)
def test_a_run_goes_on_with_what_it_began_with_alone(tmp_path, told, now, message):
    with begun(tmp_path, told(*STAGE_2), goes_on=False):
        pass
    before = (tmp_path / ".hydra/config.yaml").read_bytes()
    with pytest.raises(ConfigError, match=rf"{tmp_path} began with {message}; repeat the settings it began with, or"):
        go_on(tmp_path, told(*now))
    assert (tmp_path / ".hydra/config.yaml").read_bytes() == before


@pytest.mark.parametrize(
    "more",
    [
        ("resume=run", "hydra.run.dir=run"),
        ("resume=run/checkpoints/membership-last.ckpt", "logger=none", "trainer.threads=1", "name=again"),
        ("resume=run/checkpoints/membership-last.ckpt", "trainer=cpu", "trainer.accelerator=auto"),
        ("stage1={here}/runs/a",),
        ("stage1=runs/../runs/a/",),
        ("dataset.root=elsewhere",),
    ],
)
def test_a_run_goes_on_by_its_own_command_whatever_changes_no_figure(tmp_path, told, monkeypatch, more):
    monkeypatch.chdir(tmp_path)
    with begun(tmp_path / "run", told(*STAGE_2), goes_on=False):
        pass
    go_on(tmp_path / "run", told(*STAGE_2, *(each.format(here=tmp_path) for each in more)))


def test_a_run_that_was_moved_with_its_stage_1_goes_on(tmp_path, told, monkeypatch):
    for name in ("began", "moved"):
        (tmp_path / name / "runs/a").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "began")
    with begun(tmp_path / "began/run", told(*STAGE_2), goes_on=False):
        pass
    (tmp_path / "began/run").rename(tmp_path / "moved/run")
    monkeypatch.chdir(tmp_path / "moved")
    go_on(tmp_path / "moved/run", told(*STAGE_2))


def test_a_run_of_an_earlier_version_goes_on_with_settings_that_it_did_not_know(tmp_path, told):
    settings = told(*STAGE_2)
    del settings.stage.hand_over
    with begun(tmp_path, settings, goes_on=False):
        pass
    go_on(tmp_path, told(*STAGE_2, "stage.hand_over=last"))


def test_a_run_whose_settings_no_one_wrote_down_goes_on(tmp_path, told):
    go_on(tmp_path / "run", told(*STAGE_2))


def in_another_process(work: Callable[..., None], *arguments: object) -> BaseProcess:
    process = FORK.Process(target=work, args=arguments)
    process.start()
    return process


def train_for_ever(folder: Path, heard: Connection, loading_heard: Connection) -> None:
    """Train in a folder, beside a loading process, which outlives a training that is killed."""
    with held(folder):
        in_another_process(loading_heard.recv)
        heard.send("begun")
        signal.pause()


def try_to_train(folder: Path, heard: Connection) -> None:
    try:
        with held(folder):
            heard.send("trained")
    except ConfigError as error:
        heard.send(str(error))


def test_a_folder_is_one_process_alone_until_that_is_killed(tmp_path):
    training, training_heard = FORK.Pipe()
    loading, loading_heard = FORK.Pipe()
    process = in_another_process(train_for_ever, tmp_path, training_heard, loading_heard)
    said = rf"hydra\.run\.dir: expected a folder that no other process trains in, found {tmp_path}; wait"
    try:
        assert training.recv() == "begun"
        with pytest.raises(ConfigError, match=said), held(tmp_path):
            pass
        process.kill()
        process.join()
        with held(tmp_path):
            pass
    finally:
        process.kill()
        loading.send("end")


def test_a_folder_is_free_again_after_each_run_of_a_process(tmp_path):
    here, there = FORK.Pipe()
    for _ in range(2):
        with held(tmp_path):
            in_another_process(try_to_train, tmp_path, there).join()
            assert "no other process trains in" in here.recv()
        in_another_process(try_to_train, tmp_path, there).join()
        assert here.recv() == "trained"


def test_processes_that_train_together_share_a_folder(tmp_path, monkeypatch):
    here, there = FORK.Pipe()
    with held(tmp_path):
        monkeypatch.setattr(rank_zero_only, "rank", 1)
        in_another_process(try_to_train, tmp_path, there).join()
        assert here.recv() == "trained"


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
