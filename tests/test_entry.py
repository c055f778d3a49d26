"""A user's mistake is one message and exit code 2; a mistake of ours keeps its traceback."""

import pytest
from hydra.core.hydra_config import HydraConfig
from omegaconf import OmegaConf

from loading_process import from_a_loading_process
from most.entry import refuse_idle, run
from most.errors import ConfigError, DataError, MostError


def failing(error):
    def task():
        raise error

    return task


@pytest.mark.parametrize("kind", [MostError, ConfigError, DataError])
def test_a_users_mistake_is_its_message_alone(kind, capsys):
    with pytest.raises(SystemExit) as stop:
        run(failing(kind("scan.bin: expected points, found none")))
    assert stop.value.code == 2
    assert capsys.readouterr() == ("", "most: scan.bin: expected points, found none\n")


def test_a_mistake_that_a_loading_process_found_is_its_message_alone(capsys):
    with pytest.raises(SystemExit) as stop:
        run(from_a_loading_process(DataError("scan.bin: expected points\n  found: none")).reraise)
    assert stop.value.code == 2
    assert capsys.readouterr() == ("", "most: scan.bin: expected points\n  found: none\n")


@pytest.mark.parametrize("error", [ValueError("ours"), SystemExit(1)])
def test_anything_else_passes_through(error):
    with pytest.raises(type(error)) as passed:
        run(failing(error))
    assert passed.value is error


@pytest.mark.parametrize(("goes_on", "said"), [(True, "stopped; the same command goes on"), (False, "stopped")])
def test_whoever_stops_a_command_reads_one_line(goes_on, said, capsys):
    with pytest.raises(SystemExit) as stop:
        run(failing(KeyboardInterrupt()), goes_on)
    assert stop.value.code == 130
    assert capsys.readouterr() == ("", f"most: {said}\n")


def test_work_that_ends_well_ends_quietly(capsys):
    done = []
    run(lambda: done.append(1))
    assert done == [1]
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ("grid=nuscenes", "grid: expected none with it, found grid=nuscenes; leave it out"),
        ("+grid.voxel_size=[1,1,1]", r"grid.voxel_size: expected none with it, found \+grid"),
        ("~grid", "grid: expected none with it, found ~grid"),
    ],
)
def test_a_setting_that_cannot_act_is_refused_where_it_was_given(told, said, monkeypatch):
    hydra = OmegaConf.create({"hydra": {"overrides": {"task": ["out=a.json", told]}}})
    monkeypatch.setattr(HydraConfig.instance(), "cfg", hydra)
    refuse_idle(["gri", "outer"], "with it")  # beginnings of names are other names
    with pytest.raises(ConfigError, match=said):
        refuse_idle(["grid"], "with it")


def test_without_hydra_nothing_was_given(monkeypatch):
    monkeypatch.setattr(HydraConfig.instance(), "cfg", None)
    refuse_idle(["grid"], "with it")
