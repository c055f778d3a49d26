"""``+experiment=nuscenes_max``, unmodified, is the paper's recipe on Panoptic nuScenes."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from hydra import compose, initialize_config_dir

from most.assembly import build_network, model_parts
from most.config import Config, conf_dir, register, typed
from most.datasets.datamodule import SweepDataModule
from most.datasets.nuscenes import NuScenesSettings, SceneSplits
from most.simulation import SensorSettings, SimulationSettings, simulate


def recipe(name: str, *overrides: str) -> Config:
    register()
    with initialize_config_dir(str(conf_dir()), version_base=None):
        return typed(compose("train", [f"+experiment={name}", *overrides]))


def test_grid_is_1440_x_1440_x_40() -> None:
    grid = recipe("nuscenes_max").grid
    assert grid.voxel_size == [0.075, 0.075, 0.2]
    assert (grid.lower, grid.upper) == ([-54.0, -54.0, -5.0], [54.0, 54.0, 3.0])
    assert grid.shape == (1440, 1440, 40)


def test_key_frames_with_ten_sweeps_of_the_official_splits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUSCENES_ROOT", raising=False)
    dataset = recipe("nuscenes_max").dataset
    assert dataset == NuScenesSettings(root="data/nuscenes", sweeps=10, version="v1.0-trainval", splits=SceneSplits())
    monkeypatch.setenv("NUSCENES_ROOT", "elsewhere")
    assert recipe("nuscenes_max").dataset.root == "elsewhere"


def test_all_else_is_the_recipe_of_semantickitti() -> None:
    ours, other = recipe("nuscenes_max"), recipe("semkitti_max")
    assert replace(ours, name=other.name, dataset=other.dataset, grid=other.grid) == other


def test_network_has_nuscenes_classes() -> None:
    config = recipe("nuscenes_max")
    network = build_network(model_parts(config), config.dataset.reader().taxonomy)
    assert network.centre_head.heatmap.out_channels == 10


def test_scenes_on_the_command_line() -> None:
    config = recipe("nuscenes_max", "dataset.splits.val=[scene-1072]", "dataset.splits.train=[]")
    assert (config.dataset.splits.train, config.dataset.splits.val, config.dataset.splits.test) == (
        [],
        ["scene-1072"],
        None,
    )


def test_simulated_scenes_become_batches(tmp_path: Path) -> None:
    sensor = SensorSettings([-30.0], [10.0], [16], columns=90, max_range=30.0, labelled_range=100.0)
    simulate(SimulationSettings(["scene-0001"], 11, sensor=sensor, layout="nuscenes"), tmp_path / "tree")
    changes = [f"dataset.root={tmp_path / 'tree'}", f"dataset.tables={tmp_path / 'tables'}", "dataset.workers=0"]
    config = recipe("nuscenes_max", *changes, "dataset.splits.train=[scene-0001]", "dataset.splits.val=[scene-0001]")
    data = SweepDataModule(config.dataset, config.augment, config.extent, config.seed)
    samples = [sample for batch in data.val_dataloader() for sample in batch]
    assert [sample.index for sample in samples] == [0, 10]
    ages = samples[1].points[:, 4].unique()
    torch.testing.assert_close(ages, torch.arange(-10, 1) * 0.05, atol=1e-5, rtol=0)
    assert len(samples[1].instances) > 0
    assert {sample.index for batch in data.train_dataloader() for sample in batch} == {0, 10}
