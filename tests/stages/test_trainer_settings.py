"""Settings of the trainer, and how many batches make an effective one."""

import pytest

from most.errors import ConfigError
from most.stages.trainer import TrainerSettings


@pytest.mark.parametrize(("effective", "per_step", "expected"), [(8, 1, 8), (8, 2, 4), (8, 8, 1)])
def test_batches_accumulate_to_the_effective_one(effective, per_step, expected):
    assert TrainerSettings().accumulated(effective, per_step, "detection") == expected


@pytest.mark.parametrize(("effective", "per_step"), [(8, 3), (8, 16)])
def test_an_effective_batch_that_does_not_divide_is_refused(effective, per_step):
    with pytest.raises(
        ConfigError, match=rf"stage\.detection\.batch_size: expected a multiple of {per_step} .*found {effective}"
    ):
        TrainerSettings().accumulated(effective, per_step, "detection")


@pytest.mark.parametrize(
    "wrong", [{"threads": -1}, {"validate_every": 0}, {"log_every": 0}, {"accelerator": "abacus"}, {"precision": "8"}]
)
def test_impossible_settings_are_refused(wrong):
    ((name, value),) = wrong.items()
    with pytest.raises(ConfigError, match=rf"trainer\.{name}: expected .*found {value}"):
        TrainerSettings(**wrong)
