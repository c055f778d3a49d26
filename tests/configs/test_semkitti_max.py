"""``+experiment=semkitti_max``, unmodified, is the paper's recipe: every value of it is written out here."""

import pytest
import torch
from hydra import compose, initialize_config_dir

from most.assembly import build_network, model_parts
from most.config import conf_dir, register, typed
from most.datasets.taxonomy import Taxonomy
from most.membership import PointSegMLPSettings
from most.modal.extent import TrackMax
from most.normed_linear import NormedLinear
from most.sparse import InverseConv, StridedConv, SubmanifoldConv
from most.stages.detection import one_cycle


def recipe():
    register()
    with initialize_config_dir(str(conf_dir()), version_base=None):
        return typed(compose("train", ["+experiment=semkitti_max"]))


def network():
    taxonomy = Taxonomy.load("semantickitti")
    return build_network(model_parts(recipe()), taxonomy)


def test_grid_is_1440_x_1440_x_32():
    grid = recipe().grid
    assert grid.voxel_size == [0.075, 0.075, 0.2]
    assert grid.lower == [-54.0, -54.0, -4.0]
    assert grid.upper == [54.0, 54.0, 2.4]
    assert grid.shape == (1440, 1440, 32)


def test_eleven_sweeps_of_the_official_split():
    dataset = recipe().dataset
    assert dataset.sweeps == 10
    assert dataset.splits.train == ["00", "01", "02", "03", "04", "05", "06", "07", "09", "10"]
    assert dataset.splits.val == ["08"]
    assert dataset.splits.test == [f"{sequence}" for sequence in range(11, 22)]


def test_augmentation_and_extents():
    augment = recipe().augment
    assert (augment.flip_x, augment.flip_y) == (True, True)
    assert (augment.rotation, list(augment.scale), list(augment.translation)) == (45.0, [0.9, 1.1], [0.5] * 3)
    assert (augment.intensity, augment.half_swap) == (0, 0)
    assert recipe().extent == TrackMax(floor=0.05)
    assert recipe().membership == PointSegMLPSettings(widths=[64, 64, 64], bev=True, point=True)


def test_optimiser_schedule_and_batch():
    stage = recipe().stage.detection
    assert stage.optimizer == "adam"
    assert (stage.max_lr, stage.initial_divisor, stage.warm_up) == (1e-3, 10.0, 0.4)
    assert (stage.weight_decay, stage.clip) == (0.01, 35.0)
    assert (stage.batch_size, stage.epochs) == (8, 20)
    accumulated = recipe().trainer.accumulated(stage.batch_size, recipe().dataset.batch_size, "detection")
    assert accumulated * recipe().dataset.batch_size == 8


def test_stage_2_follows_on_the_best_stage_1():
    stage = recipe().stage
    assert (stage.run, stage.hand_over) == (["detection", "membership"], "best")
    second = stage.membership
    assert (second.lr, second.momentum, second.epochs, second.batch_size) == (5e-4, 0.9, 20, 8)
    assert second.mixing.scans == 0


def test_losses_and_targets():
    weights = recipe().stage.detection.losses
    assert (weights.voxel, weights.point, weights.heatmap, weights.height, weights.velocity) == (1, 1, 1, 1, 1)
    assert (weights.offset, weights.extent, weights.class_balance) == (1, 1, 0)
    targets = recipe().stage.detection.targets
    assert (targets.kind, targets.min_variance, targets.min_points) == ("variance", 1.0, 1)


def test_inference():
    inference = recipe().inference
    assert inference.roi.sphere is False
    assert (inference.fusion.overlap, inference.fusion.unclaimed, inference.fusion.reach) == (
        "confident",
        "nearest",
        1.5,
    )


def test_point_mlp_widths():
    layers = [module for module in network().encoder.modules() if isinstance(module, NormedLinear)]
    assert [layer.linear.out_features for layer in layers] == [64, 128, 256, 32]


def test_backbone_widths_and_kernels():
    modules = list(network().backbone.modules())
    submanifold = [module for module in modules if isinstance(module, SubmanifoldConv)]
    assert {tuple(module.kernel) for module in submanifold} == {(3, 1, 3), (1, 3, 3)}
    assert len(submanifold) == 7 * 4
    strided = [module for module in modules if isinstance(module, StridedConv)]
    assert [module.kernel for module in strided] == [3, 3, 3]
    assert [module.weight.shape[0] for module in strided] == [32, 64, 128]
    assert len([module for module in modules if isinstance(module, InverseConv)]) == 3
    assert network().backbone.voxel_channels == 16


def test_bev_branch_and_head():
    planar = [module for module in network().backbone.modules() if isinstance(module, torch.nn.Conv2d)]
    assert [(conv.in_channels, conv.out_channels, conv.kernel_size) for conv in planar] == [
        (512, 128, (3, 3)),
        (128, 128, (3, 3)),
    ]
    head = network().centre_head
    assert (head.shared[0].out_channels, head.heatmap.out_channels) == (64, 8)
    assert abs(head.heatmap.bias[0].item() + 2.19) < 1e-6


def test_adam_under_a_one_cycle_schedule():
    optimizer, schedule = one_cycle([torch.nn.Parameter(torch.zeros(1))], recipe().stage.detection, steps=100)
    assert type(optimizer) is torch.optim.Adam
    assert optimizer.param_groups[0]["weight_decay"] == 0.01
    rates = []
    for _ in range(100):
        rates.append(optimizer.param_groups[0]["lr"])
        optimizer.step()
        schedule.step() if len(rates) < 100 else None
    assert rates[0] == pytest.approx(1e-3 / 10)
    assert max(rates) == pytest.approx(1e-3)
    assert abs(rates.index(max(rates)) - 39) <= 1
