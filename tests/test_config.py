"""Components described in plain types, as checkpoints keep them, and made again."""

import json

import pytest
from omegaconf import OmegaConf

from most.config import COMPONENTS, Config, from_plain, to_plain, typed
from most.errors import ConfigError


@pytest.mark.parametrize(("group", "name"), [(group, name) for group, known in COMPONENTS.items() for name in known])
def test_every_component_survives_its_plain_description(group, name):
    component = COMPONENTS[group][name]()
    plain = json.loads(json.dumps(to_plain(group, component)))
    assert plain["component"] == name
    again = from_plain(group, plain)
    assert type(again) is type(component)
    assert again == component


def test_what_is_not_the_default_survives_too():
    plain = to_plain("grid", COMPONENTS["grid"]["grid"](voxel_size=[0.5, 0.25, 1.0]))
    assert from_plain("grid", plain).voxel_size == [0.5, 0.25, 1.0]


@pytest.mark.parametrize(
    ("group", "plain", "message"),
    [
        ("backbone", {"component": "transformer", "settings": {}}, "backbone: expected one of .*found transformer"),
        ("grid", {"component": "grid", "settings": {"spin": 1}}, r"grid\.spin"),
        ("grid", {"component": "grid", "settings": {"voxel_size": "small"}}, r"grid\.voxel_size"),
        ("grid", {"component": "grid", "settings": {"voxel_size": [0.0, 1.0, 1.0]}}, r"grid\.voxel_size: expected pos"),
        (
            "grid",
            {"component": "grid", "settings": {"voxel_size": [999.0, 1, 1]}},
            "expected 1 to 32768 voxels .*found .0",
        ),
        ("encoder", {"component": "encoder", "settings": {"widths": []}}, r"encoder\.widths: expected"),
    ],
)
def test_descriptions_that_make_no_component_are_refused(group, plain, message):
    with pytest.raises(ConfigError, match=message):
        from_plain(group, plain)


@pytest.mark.parametrize("seed", [-1, 2**32])
def test_seeds_that_no_generator_takes_are_refused(seed):
    with pytest.raises(ConfigError, match=f"seed: expected a number .*found {seed}"):
        Config(seed=seed)


def test_a_number_that_is_none_is_refused_wherever_it_stands():
    with pytest.raises(ConfigError, match=r"a\.b\.1: expected a finite number, found inf"):
        typed(OmegaConf.create({"a": {"b": [1.0, float("inf")]}}))


def test_a_value_that_has_to_be_given_is_asked_for():
    with pytest.raises(ConfigError, match=r"out: expected a value, found none; say out=\.\.\."):
        typed(OmegaConf.create({"first": 1, "out": "???"}))
