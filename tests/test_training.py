"""A training put together."""

from pathlib import Path

import torch

from most.assembly import describe, describe_run, model_parts
from most.config import Config, Heads
from most.datasets.augment import Augment
from most.datasets.datamodule import SweepDataModule
from most.datasets.semantickitti import SemanticKITTISettings, Splits
from most.modal.extent import TrackMax
from most.stages.settings import StageSettings
from most.stages.trainer import TrainerSettings
from most.training import build_stage
from semantickitti_tree import write_sequence
from tiny import TAXONOMY, tiny_parts, tiny_predictor


def test_stage_1_begins_with_the_network_of_another_training(tmp_path: Path) -> None:
    write_sequence(tmp_path / "tree", "00", range(2))
    parts = tiny_parts()
    config = Config(
        dataset=SemanticKITTISettings(str(tmp_path / "tree"), splits=Splits(train=["00"], val=["00"])),
        augment=Augment(), extent=TrackMax(), trainer=TrainerSettings(), stage=StageSettings(),
        heads=Heads(parts["centre_head"], parts["semantic_head"]),
        **{name: parts[name] for name in ("grid", "encoder", "backbone", "membership", "inference")},
    )  # fmt: skip
    trained = tiny_predictor(seed=7).network.state_dict()
    torch.save(
        {
            "most": describe(model_parts(config), TAXONOMY, 2),
            "most_run": describe_run(config, "detection", []),
            "state_dict": {f"network.{name}": value for name, value in trained.items()},
        },
        tmp_path / "trained.ckpt",
    )
    data = SweepDataModule(config.dataset, config.augment, config.extent, config.seed)
    for weights, same in ((None, False), (str(tmp_path / "trained.ckpt"), True)):
        config.weights = weights
        network = build_stage("detection", config, data, tmp_path).network
        assert all(torch.equal(network.state_dict()[name], value) for name, value in trained.items()) is same
