"""A device that is not there is refused before any work."""

import pytest
import torch

from most.device import chosen_device
from most.errors import ConfigError
from most.oracle import OracleConfig
from most.predict import PredictConfig


@pytest.mark.parametrize(
    ("name", "there", "chosen"),
    [("auto", True, "cuda"), ("auto", False, "cpu"), ("cpu", True, "cpu"), ("cuda", True, "cuda")],
)
def test_a_gpu_is_taken_where_there_is_one_unless_the_user_says_otherwise(name, there, chosen, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: there)
    assert chosen_device(name) == torch.device(chosen)


@pytest.mark.parametrize("config", [PredictConfig, OracleConfig])
@pytest.mark.parametrize("name", ["cuda", "tpu"])
def test_what_is_not_there_is_refused(name, config, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ConfigError, match=f"device: expected auto, cpu, or cuda where there is a GPU, found {name}"):
        config(device=name)
