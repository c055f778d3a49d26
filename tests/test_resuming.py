"""Going on with a run: only with the model and the schedule that it began with."""

import pytest
import torch

from most.assembly import describe
from most.backbones import AsymmetricUNetSmallSettings
from most.config import Config, Heads
from most.datasets.datamodule import SemanticKITTISettings
from most.errors import ConfigError, DataError
from most.resuming import check_resume
from most.stages.detection import DetectionTraining
from most.stages.settings import StageSettings
from tiny import TAXONOMY, tiny_parts


@pytest.fixture
def config(tmp_path):
    """A configuration that goes on from a checkpoint of its own."""
    parts = tiny_parts()
    made = Config(
        resume=str(tmp_path / "last.ckpt"), dataset=SemanticKITTISettings(sweeps=2),
        stage=StageSettings(detection=DetectionTraining(epochs=4)),
        heads=Heads(parts["centre_head"], parts["semantic_head"]),
        **{name: parts[name] for name in ("grid", "encoder", "backbone", "membership", "inference")},
    )  # fmt: skip
    torch.save(
        {"most": describe(parts, TAXONOMY, 2), "most_stage": "detection", "most_epochs": 4, "state_dict": {}},
        tmp_path / "last.ckpt",
    )
    return made


def test_the_same_run_may_go_on(config):
    check_resume(config, TAXONOMY)


def test_another_model_may_not(config):
    config.backbone = AsymmetricUNetSmallSettings(widths=[4, 4, 8, 16], bev_channels=8)
    with pytest.raises(ConfigError, match=r"resume: .*last\.ckpt was trained with another model or dataset"):
        check_resume(config, TAXONOMY)


def test_another_window_may_not(config):
    config.dataset.sweeps = 3
    with pytest.raises(ConfigError, match="another model or dataset"):
        check_resume(config, TAXONOMY)


def test_another_length_may_not(config):
    config.stage.detection.epochs = 8
    with pytest.raises(ConfigError, match=r"stage\.detection\.epochs: expected 4, .*found 8"):
        check_resume(config, TAXONOMY)


def test_a_missing_checkpoint_is_named(config, tmp_path):
    config.resume = str(tmp_path / "none.ckpt")
    with pytest.raises(DataError, match=r"none\.ckpt: expected a checkpoint, found no file"):
        check_resume(config, TAXONOMY)
