"""Loggers: each kind, and that no account is needed."""

import os
from contextlib import nullcontext

import pytest
import wandb
from lightning.pytorch.loggers import CSVLogger, WandbLogger

from most.errors import ConfigError, StoppedError
from most.logs import LoggerSettings, ended
from wandb_run import read_run


def test_none_logs_nowhere(tmp_path):
    assert LoggerSettings(kind="none").build(tmp_path, "a", {}) is False


def test_csv_is_written_into_the_run_folder(tmp_path):
    logger = LoggerSettings(kind="csv").build(tmp_path, "a", {})
    assert isinstance(logger, CSVLogger)
    logger.log_metrics({"train/loss": 2.5}, step=0)
    logger.save()
    assert (tmp_path / "csv" / "metrics.csv").read_text().splitlines() == ["step,train/loss", "0,2.5"]


def test_wandb_is_offline_unless_asked_and_knows_the_configuration(tmp_path, no_account):
    no_account.setenv("WANDB_API_KEY", "0" * 40)
    logger = LoggerSettings(project="streets", group="all").build(tmp_path, "a", {"seed": 1})
    assert isinstance(logger, WandbLogger)
    assert os.environ["WANDB_MODE"] == "offline"
    init = logger._wandb_init  # what the run will be started with, at the first thing that is logged
    assert (init["name"], init["project"], init["group"], init["config"]) == ("a", "streets", "all", {"seed": 1})
    assert init["dir"] == str(tmp_path)


def test_online_needs_a_key(no_account):
    with pytest.raises(ConfigError, match=r"logger\.mode: expected a key for W&B online, found none; run wandb login"):
        LoggerSettings(mode="online").check_account()


def test_a_key_that_can_be_none_is_refused_with_the_reason(no_account):
    no_account.setenv("WANDB_API_KEY", "abc")
    with pytest.raises(ConfigError, match=r"logger\.mode: expected a key .*, found one that W&B does not take: .*40"):
        LoggerSettings(mode="online").check_account()


@pytest.mark.parametrize("settings", [{}, {"kind": "csv", "mode": "online"}, {"kind": "none", "mode": "online"}])
def test_what_is_not_sent_needs_none(no_account, settings):
    LoggerSettings(**settings).check_account()


def test_a_key_of_the_environment_is_taken(tmp_path, no_account):
    no_account.setenv("WANDB_API_KEY", "0" * 40)
    settings = LoggerSettings(mode="online")
    settings.check_account()
    settings.build(tmp_path, "a", {})
    assert os.environ["WANDB_MODE"] == "online"


def test_the_key_of_wandb_login_is_taken(tmp_path, no_account):
    netrc = tmp_path / "netrc"
    netrc.write_text(f"machine api.wandb.ai login user password {'0' * 40}\n")
    netrc.chmod(0o600)
    no_account.setenv("NETRC", str(netrc))
    LoggerSettings(mode="online").check_account()


@pytest.mark.parametrize("wrong", [{"kind": "tensorboard"}, {"mode": "cloud"}, {"pictures": -1}])
def test_impossible_settings_are_refused(wrong):
    ((name, value),) = wrong.items()
    with pytest.raises(ConfigError, match=rf"logger\.{name}: expected .*found {value}"):
        LoggerSettings(**wrong)


@pytest.mark.parametrize(("stop", "code"), [(None, 0), (ZeroDivisionError(), 1), (StoppedError("resume=FILE", 130), 1)])
def test_a_run_that_did_not_reach_its_end_is_no_finished_one(tmp_path, no_account, stop, code):
    with pytest.raises(type(stop)) if stop else nullcontext(), ended():
        wandb.init(dir=tmp_path, mode="offline", name="a")
        if stop:
            raise stop
    assert wandb.run is None
    assert read_run(tmp_path).exit_code == code
