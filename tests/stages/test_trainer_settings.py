"""Settings of the trainer, and how many batches make an effective one."""

import pytest

from most.errors import ConfigError
from most.stages.trainer import TrainerSettings


@pytest.mark.parametrize(
    ("effective", "per_step", "devices", "nodes", "expected"),
    [(8, 1, 1, 1, 8), (8, 2, 1, 1, 4), (8, 8, 1, 1, 1), (8, 1, 8, 1, 1), (48, 2, 4, 3, 2)],
)
def test_batches_accumulate_to_the_effective_one(effective, per_step, devices, nodes, expected):
    assert TrainerSettings(devices=devices, nodes=nodes).accumulated(effective, per_step) == expected


@pytest.mark.parametrize(("effective", "per_step", "devices"), [(8, 3, 1), (8, 16, 1), (2, 1, 4)])
def test_an_effective_batch_that_does_not_divide_is_refused(effective, per_step, devices):
    with pytest.raises(ConfigError, match=rf"stage\.batch_size: expected a multiple .*found {effective}"):
        TrainerSettings(devices=devices).accumulated(effective, per_step)


@pytest.mark.parametrize("key", ["devices", "nodes", "validate_every", "log_every"])
def test_impossible_settings_are_refused(key):
    with pytest.raises(ConfigError, match=rf"trainer\.{key}: expected at least 1, found 0"):
        TrainerSettings(**{key: 0})
