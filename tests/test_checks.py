"""What a training is asked to do is held against what there is, before any work."""

from contextlib import nullcontext
from dataclasses import asdict, replace
from pathlib import Path

import pytest
import torch

from most.assembly import FORMAT, describe, describe_run, model_parts, stage1_parts, training_of
from most.backbones import AsymmetricUNetSmallSettings
from most.checks import check_devices, check_resume, check_stage1, stages_to_run
from most.config import Config, Heads, OffsetHeads, to_plain
from most.datasets.augment import Augment
from most.datasets.reader import Frame
from most.datasets.semantickitti import SemanticKITTI, SemanticKITTISettings, Splits
from most.errors import ConfigError, DataError
from most.heads import OffsetHead, OrientedCentreHead
from most.logs import LoggerSettings
from most.membership import Clustering, MeanShift, Nearest, PointSegMLPSettings
from most.modal.amodal import Amodal
from most.modal.extent import DropSmall, TrackMax
from most.stages.detection import DetectionTraining
from most.stages.membership import MembershipTraining
from most.stages.settings import StageSettings
from most.stages.trainer import TrainerSettings
from semantickitti_tree import write_sequence
from tiny import TAXONOMY, tiny_parts

FRAMES = [Frame("00", index) for index in range(4)]


@pytest.fixture
def reader(tmp_path: Path) -> SemanticKITTI:
    write_sequence(tmp_path / "tree", "00", range(4))
    return SemanticKITTI(tmp_path / "tree", Splits(train=["00"], val=["00"]))


@pytest.fixture
def config() -> Config:
    parts = tiny_parts()
    return Config(
        dataset=SemanticKITTISettings(sweeps=2), augment=Augment(), extent=TrackMax(), trainer=TrainerSettings(),
        logger=LoggerSettings(),
        stage=StageSettings(detection=DetectionTraining(epochs=4), membership=MembershipTraining(epochs=2)),
        heads=Heads(parts["centre_head"], parts["semantic_head"]), membership=PointSegMLPSettings([4]),
        **{name: parts[name] for name in ("grid", "encoder", "backbone", "inference")},
    )  # fmt: skip


def save(config: Config, folder: Path, stage: str) -> Path:
    """A checkpoint of a run of this configuration, without weights."""
    parts = model_parts(config) | ({"membership": Nearest()} if stage == "detection" else {})
    path = folder / "checkpoints" / f"{stage}-last.ckpt"
    path.parent.mkdir(exist_ok=True)
    content = {
        "most": describe(parts, TAXONOMY, 2),
        "most_run": describe_run(config, stage, FRAMES),
        "state_dict": {},
        "optimizer_states": [],
    }
    torch.save(content, path)
    return path


@pytest.mark.parametrize(
    ("stage", "left"), [("detection", ["detection", "membership"]), ("membership", ["membership"])]
)
def test_a_run_goes_on_with_the_stage_of_its_checkpoint(config, reader, tmp_path, stage, left):
    config.resume = str(save(config, tmp_path, stage))
    assert stages_to_run(config, reader, tmp_path) == left


def test_a_run_goes_on_from_before_a_setting_was_there(config, reader, tmp_path):
    """Settings that a checkpoint does not know have their defaults, or the run is another one."""
    path = save(config, tmp_path, "detection")
    saved = torch.load(path, weights_only=True)
    del saved["most_run"]["training"]["losses"]["yaw"], saved["most"]["parts"]["inference"]["settings"]["fusion"]
    torch.save(saved, path)
    config.resume = str(path)
    assert check_resume(config, reader, tmp_path) == "detection"
    config.stage.detection.losses.yaw = 2.0
    with pytest.raises(ConfigError, match=r"training\.losses\.yaw = 1\.0, found 2\.0"):
        check_resume(config, reader, tmp_path)


def test_amodal_extents_are_refused_without_boxes_and_have_a_head_of_their_own(config, reader, tmp_path):
    config.extent = Amodal()
    assert isinstance(model_parts(config)["centre_head"], OrientedCentreHead)
    with pytest.raises(ConfigError, match=r"extent: expected amodal boxes for each sequence of the split train"):
        stages_to_run(config, reader, tmp_path)


def test_extents_of_points_too_few_are_no_targets(config):
    assert training_of(config, "detection") is config.stage.detection
    config.extent = DropSmall(min_points=3)
    assert training_of(config, "detection").targets.min_points == 3
    assert training_of(config, "membership") is config.stage.membership
    assert describe_run(config, "detection", FRAMES)["training"]["targets"]["min_points"] == 3
    assert config.stage.detection.targets.min_points == 1


def test_dropping_what_is_dropped_anyway_is_refused(config, reader, tmp_path):
    config.extent, config.stage.detection.targets.min_points = DropSmall(min_points=3), 3
    with pytest.raises(ConfigError, match=r"extent\.min_points: expected more than .*min_points = 3, .*, found 3"):
        stages_to_run(config, reader, tmp_path)


def test_a_run_begins_with_its_first_stage(config, reader, tmp_path):
    assert stages_to_run(config, reader, tmp_path) == ["detection", "membership"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"backbone": AsymmetricUNetSmallSettings(widths=[4, 4, 8, 16], bev_channels=8)}, r"found \[4, 4, 8, 16\]"),
        ({"dataset": SemanticKITTISettings(sweeps=3)}, "sweeps = 2, found 3"),
        ({"dataset": SemanticKITTISettings(sweeps=2, batch_size=2)}, "batch_size = 1, found 2"),
        ({"stage": StageSettings(detection=DetectionTraining(epochs=8))}, r"training\.epochs = 4, found 8"),
        ({"augment": Augment(rotation=10.0)}, r"augment\.rotation = 0\.0, found 10\.0"),
        ({"extent": TrackMax(floor=0.1)}, r"extent\.settings\.floor = 0\.05, found 0\.1"),
        ({"seed": 2}, "seed = 1, found 2"),
    ],
)  # fmt: skip
def test_a_run_does_not_go_on_with_other_settings(config, reader, tmp_path, change, message):
    config.resume = str(save(config, tmp_path, "detection"))
    for name, value in change.items():
        setattr(config, name, value)
    with pytest.raises(ConfigError, match=rf"resume: .*detection-last\.ckpt began with .*{message}; repeat"):
        check_resume(config, reader, tmp_path)


def test_a_run_does_not_go_on_with_other_scans_in_another_folder_or_with_another_stage(config, reader, tmp_path):
    config.resume = str(save(config, tmp_path, "membership"))
    with pytest.raises(ConfigError, match=rf"expected the run's own folder, .*add hydra\.run\.dir={tmp_path}"):
        check_resume(config, reader, tmp_path / "other")
    (reader.root / "sequences/00/velodyne/000003.bin").unlink()
    with pytest.raises(ConfigError, match=r"began with scans\.00 = 4, found 3"):
        check_resume(config, SemanticKITTI(reader.root, reader.splits), tmp_path)
    config.stage.run = ["detection"]
    with pytest.raises(ConfigError, match="is of stage membership; expected one of detection"):
        check_resume(config, reader, tmp_path)


def test_a_missing_checkpoint_and_one_of_an_older_format_are_named(config, reader, tmp_path):
    config.resume = str(tmp_path / "none.ckpt")
    with pytest.raises(DataError, match=r"none\.ckpt: expected a checkpoint, found no file"):
        check_resume(config, reader, tmp_path)
    torch.save({"most": {"format": 1}, "state_dict": {}}, tmp_path / "none.ckpt")
    with pytest.raises(DataError, match=rf"expected checkpoint format {FORMAT}, found 1"):
        check_resume(config, reader, tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"membership": Nearest()}, "expected one that stage 2 can train, such as full, found nearest"),
        ({"trainer": TrainerSettings(devices=5, accelerator="cpu")}, "as split train has scans, 4, found 5"),
        ({"stage": StageSettings(membership=MembershipTraining(batch_size=3)),
          "dataset": SemanticKITTISettings(batch_size=2)}, r"stage\.membership\.batch_size: expected a multiple of 2"),
    ],
)  # fmt: skip
def test_what_stage_2_cannot_do_is_refused_before_stage_1(config, reader, tmp_path, change, message):
    for name, value in change.items():
        setattr(config, name, value)
    with pytest.raises(ConfigError, match=message):
        stages_to_run(config, reader, tmp_path)


OFFSETS = {"heads": OffsetHeads(OffsetHead(8))}


@pytest.mark.parametrize(
    ("run", "change", "message"),
    [
        (["detection", "membership"], OFFSETS, "modal_centres.*; with it say stage=detection"),
        (["detection"], {**OFFSETS, "membership": Nearest()}, "found nearest; choose another, or heads=modal_centres"),
        (["detection"], {"membership": MeanShift()}, "found mean_shift; choose another, or heads=offset_regression"),
        (["detection", "membership"], {"membership": Clustering()}, "full, found clustering; with it say stage=detect"),
    ],
)
def test_a_membership_that_has_nothing_to_stand_on_is_refused(config, reader, tmp_path, run, change, message):
    config.stage.run = run
    for name, value in change.items():
        setattr(config, name, value)
    with pytest.raises(ConfigError, match=rf"(membership|heads): expected .*{message}"):
        stages_to_run(config, reader, tmp_path)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({}, "nearest"),
        (OFFSETS, "mean_shift"),
        ({**OFFSETS, "membership": Clustering()}, "clustering"),
        ({"membership": Clustering(link=2.0)}, "clustering"),
    ],
)
def test_stage_1_by_itself_knows_a_membership_without_training(config, reader, tmp_path, change, name):
    config.stage.run = ["detection"]
    for key, value in change.items():
        setattr(config, key, value)
    assert stages_to_run(config, reader, tmp_path) == ["detection"]
    assert to_plain("membership", stage1_parts(config)["membership"])["component"] == name


def test_settings_that_came_after_a_checkpoint_are_at_their_defaults(config, reader, tmp_path):
    path = save(config, tmp_path, "detection")
    content = torch.load(path)
    del content["most"]["parts"]["backbone"]["settings"]["separate"]
    torch.save(content, path)
    config.resume = str(path)
    assert check_resume(config, reader, tmp_path) == "detection"
    config.resume, config.stage1, config.stage.run = None, str(path), ["membership"]
    check_stage1(config, TAXONOMY)
    config.backbone.separate = True
    with pytest.raises(ConfigError, match=r"was trained with another backbone: .*'separate': True.*'separate': False"):
        check_stage1(config, TAXONOMY)


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_a_gpu_that_is_not_there_is_refused(config, reader, tmp_path):
    for devices in (1, -1):
        config.trainer = TrainerSettings(accelerator="gpu", devices=devices)
        with pytest.raises(ConfigError, match=r"trainer.accelerator: expected a GPU.* found none; say trainer=cpu"):
            stages_to_run(config, reader, tmp_path)


@pytest.mark.parametrize(
    ("settings", "told"),
    [({"devices": -1}, "trainer.devices: .*found -1"), ({"precision": "bf16-mixed"}, "trainer.precision: .*on a CPU")],
)
def test_what_only_gpus_do_is_refused_on_a_cpu(config, reader, tmp_path, settings, told):
    config.trainer = TrainerSettings(accelerator="cpu", **settings)
    with pytest.raises(ConfigError, match=told):
        stages_to_run(config, reader, tmp_path)


@pytest.mark.parametrize(("there", "devices"), [(1, 2), (2, 3)])
def test_more_gpus_than_there_are_are_refused_whoever_chose_them(monkeypatch, there, devices):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: there)
    for accelerator in ("auto", "gpu"):
        with pytest.raises(ConfigError, match=f"than the {there} there are, found {devices}"):
            check_devices(TrainerSettings(accelerator=accelerator, devices=devices))
        check_devices(TrainerSettings(accelerator=accelerator, devices=there))
    check_devices(TrainerSettings(accelerator="cpu", devices=devices))


def test_the_folder_of_a_run_stands_for_its_newest_checkpoint(config, reader, tmp_path):
    (tmp_path / "empty").mkdir()
    config.resume = str(tmp_path / "empty")
    with pytest.raises(ConfigError, match=r"resume: expected a run's folder with .*last\.ckpt, found none in .*empty"):
        stages_to_run(config, reader, tmp_path)
    config.resume = str(tmp_path)
    for stage, left in (("detection", ["detection", "membership"]), ("membership", ["membership"])):
        save(config, tmp_path, stage)
        assert stages_to_run(config, reader, tmp_path) == left


def test_a_folder_of_checkpoints_names_the_one_that_goes_on(config, reader, tmp_path):
    best = save(config, tmp_path, "detection").rename(tmp_path / "checkpoints/detection-best.ckpt")
    with pytest.raises(ConfigError, match=rf"found {best}; choose another one$"):
        stages_to_run(config, reader, tmp_path)
    for stage in ("detection", "membership"):
        last = save(config, tmp_path, stage)
        with pytest.raises(ConfigError, match=rf"found {best}; choose another one, or go on with resume={last}$"):
            stages_to_run(config, reader, tmp_path)


def test_checkpoints_of_another_run_are_not_overwritten(config, reader, tmp_path):
    kept = save(config, tmp_path, "detection")
    with pytest.raises(ConfigError, match=rf"expected a folder of no other run, found {kept}; .*resume={kept}"):
        stages_to_run(config, reader, tmp_path)


def test_figures_of_another_run_are_not_overwritten_where_its_checkpoints_are_gone(config, reader, tmp_path):
    (tmp_path / "metrics.json").write_text("{}")
    with pytest.raises(ConfigError, match=r"folder of no other run, found .*metrics.json; choose another one$"):
        stages_to_run(config, reader, tmp_path)


def test_logging_online_needs_an_account_before_any_work(config, reader, tmp_path, monkeypatch):
    monkeypatch.setattr("wandb.login", lambda verify: False)
    monkeypatch.setenv("WANDB_MODE", "offline")
    config.logger = LoggerSettings(mode="online")
    with pytest.raises(ConfigError, match=r"logger\.mode: expected a key for W&B"):
        stages_to_run(config, reader, tmp_path)


def test_weights_to_begin_with_are_those_of_the_same_network(config, reader, tmp_path):
    config.weights = str(save(config, tmp_path, "detection"))
    folder = tmp_path / "new"
    config.dataset.sweeps, config.grid = 5, replace(config.grid, voxel_size=[0.25, 0.25, 0.5])
    assert stages_to_run(config, reader, folder) == ["detection", "membership"]  # another window, other voxels
    config.grid = replace(config.grid, upper=[8.0, 8.0, 6.0])
    with pytest.raises(ConfigError, match="weights: expected a grid of as many layers as this one, 16, found 8"):
        stages_to_run(config, reader, folder)
    config.backbone = AsymmetricUNetSmallSettings(widths=[4, 4, 8, 16], bev_channels=8)
    with pytest.raises(ConfigError, match=r"weights: .* another backbone: expected .*16\].* found .*8\]"):
        stages_to_run(config, reader, folder)


def test_weights_to_begin_with_are_not_for_stage_2(config, reader, tmp_path):
    config.weights = config.stage1 = str(save(config, tmp_path, "detection"))
    config.stage.run = ["membership"]
    with pytest.raises(ConfigError, match="weights: expected none where stage 1 is not trained"):
        stages_to_run(config, reader, tmp_path / "new")


def test_what_a_run_says_of_itself_is_plain(config):
    said = describe_run(config, "membership", FRAMES)
    assert said["training"] == asdict(config.stage.membership)


def test_a_run_whose_stage_1_has_not_ended_is_no_stage_1(config, reader, tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    path = save(config, run, "detection")
    config.stage1, config.stage.run, config.stage.hand_over = str(run), ["membership"], "last"
    for done, refused in ((3, True), (4, False)):
        progress = {"fit_loop": {"epoch_progress": {"current": {"processed": done}}}}
        torch.save(torch.load(path, weights_only=True) | {"loops": progress}, path)
        with (
            pytest.raises(ConfigError, match=r"has ended, found 3 of 4 epochs in .*last\.ckpt")
            if refused
            else nullcontext()
        ):
            assert stages_to_run(config, reader, tmp_path / "new") == ["membership"]


def test_a_stage_1_of_another_extent_is_refused(config, reader, tmp_path):
    config.stage1, config.stage.run = str(save(config, tmp_path, "detection")), ["membership"]
    config.extent = DropSmall()
    with pytest.raises(ConfigError, match=r"another extent: expected .*drop_small.* found .*track_max"):
        stages_to_run(config, reader, tmp_path / "new")
