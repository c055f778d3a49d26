"""What a user can get wrong ends in one message, exit code 2, and nothing half-written."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import nuscenes_tree
from commands import SPLITS, TINY, Command
from semantickitti_tree import write_sequence

TRAIN = ["+experiment=sim_demo", "dataset.root=tree", "dataset.tables=tables", *SPLITS, *TINY, "logger=none",
         "logger.pictures=0", "trainer.progress_bar=false", "stage=detection", "hydra.run.dir=run"]  # fmt: skip
PREDICT = ["dataset=simulated", "dataset.root=tree", "dataset.workers=0", "split=val", "out=out", *SPLITS]
EVALUATE = ["dataset=simulated", "dataset.root=tree", "split=val", "predictions=out", *SPLITS]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a tree of two sequences of four scans."""
    for name in ("00", "01"):
        write_sequence(tmp_path / "tree", name, range(4))
    return tmp_path


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stage 1 trained on such a tree."""
    folder = tmp_path_factory.mktemp("trained")
    for name in ("00", "01"):
        write_sequence(folder / "tree", name, range(4))
    done = Command(folder, "train", *TRAIN, "stage.detection.epochs=1").done()
    assert done.returncode == 0, done.stderr
    return folder / "run" / "checkpoints" / "detection-last.ckpt"


def refused(folder: Path, command: str, *arguments: str, **limits: int) -> str:
    """Run a command that must be refused; return its message."""
    done = Command(folder, command, *arguments, **limits).done()
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr.count("most: ") == 1
    assert not list(folder.rglob("*.part"))
    return done.stderr[done.stderr.index("most: ") :]


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("stage.detection.learning_rate=1", ["learning_rate", "not in 'DetectionTraining'"]),
        ("extent=trackmax", ["extent/trackmax", "amodal", "class_mean", "drop_small", "shrink_wrap", "track_max"]),
        ("extent=amodal", ["extent: expected amodal boxes", "found none for 00 in tree", "extent, such as track_max"]),
        ("backbone=resnet", ["backbone/resnet", "asymmetric_unet_small", "residual_unet"]),
        ("trainer.precision=8", ["trainer.precision", "bf16-mixed", "found 8"]),
        ("dataset.batch_size=two", ["dataset.batch_size", "two", "Integer"]),
        ("seed=-1", ["seed", "expected a number in [0, 2^32), found -1"]),
        ("stage=membership", ["stage1: expected a checkpoint of stage 1, found none", "stage1=FILE"]),
        ("stage1=some.ckpt", ["stage1: expected none where stage 1 is trained anew"]),
        ("stage.detection.batch_size=3 dataset.batch_size=2", ["detection.batch_size", "multiple of 2", "found 3"]),
        ("dataset.root=nowhere", ["nowhere/sequences", "velodyne", "most.simulate"]),
    ],
)  # fmt: skip
def test_settings_are_refused_before_any_work(folder: Path, argument: str, words: list[str]) -> None:
    message = refused(folder, "train", *TRAIN, *argument.split())
    assert all(word in message for word in words), message
    assert not (folder / "run").exists()
    assert not (folder / "tables").exists()


def test_a_refused_training_leaves_what_a_finished_one_was_told(folder: Path, checkpoint: Path) -> None:
    run = checkpoint.parents[1]
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    assert {"config.yaml", "hydra.yaml", "overrides.yaml"} <= {path.name for path in before}
    told = [*TRAIN, f"hydra.run.dir={run}", "extent=shrink_wrap", "seed=7"]
    refused(folder, "train", *told)
    refused(folder, "train", *told, f"resume={checkpoint}")
    assert {path: path.read_bytes() for path in run.rglob("*") if path.is_file()} == before


def test_a_forgotten_plus_sign_is_shown(folder: Path) -> None:
    message = refused(folder, "train", "experiment=sim_demo", *TRAIN[1:])
    assert "To append to your default list use +experiment=sim_demo" in message


def cut(path: Path, size: int) -> None:
    path.write_bytes(path.read_bytes()[:size])


BROKEN: dict[str, tuple[Callable[[Path], object], list[str]]] = {
    "scan of half a point": (
        lambda tree: cut(tree / "velodyne/000001.bin", 100),
        ["velodyne/000001.bin", "multiple of 16 bytes", "found 100", "copy it again"],
    ),
    "labels of another length": (
        lambda tree: cut(tree / "labels/000001.label", 16),
        ["labels/000001.label", "found 4"],
    ),
    "label of no class": (
        lambda tree: np.full(9, 400, "<u4").tofile(tree / "labels/000001.label"),
        ["index=1", "found 400"],
    ),
    "missing labels": (lambda tree: (tree / "labels/000001.label").unlink(), ["000001.label", "found"]),
    "poses that end early": (
        lambda tree: (tree / "poses.txt").write_text("".join((tree / "poses.txt").read_text().splitlines(True)[:2])),
        ["poses.txt", "found 2"],
    ),
    "poses that are no numbers": (
        lambda tree: (tree / "poses.txt").write_text("nan " * 12 + "\n"),
        ["poses.txt, line 1", "12 finite number(s)"],
    ),
    "calibration without Tr": (
        lambda tree: (tree / "calib.txt").write_text("P0: 1 0 0\n"),
        ["calib.txt", "'Tr: ...'", "found P0"],
    ),
}


@pytest.mark.parametrize("fault", BROKEN)
@pytest.mark.parametrize("workers", [0, 1])
def test_a_broken_dataset_is_refused_by_name(folder: Path, fault: str, workers: int) -> None:
    damage, words = BROKEN[fault]
    damage(folder / "tree" / "sequences" / "00")
    message = refused(folder, "train", *TRAIN, f"dataset.workers={workers}")
    assert all(word in message for word in words), message


ORACLE = ["dataset=simulated", "dataset.root=tree", "dataset.tables=tables", "dataset.workers=0", *SPLITS]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["checkpoint=no.ckpt"], ["no.ckpt: expected a checkpoint, found no file"]),
        (["split=test"], ["split=test: expected labels, found none of 11", "choose another split"]),
        (["split=all"], ["split", "train, val, test"]),
        (["dataset.root=nowhere"], ["nowhere/sequences", "most.simulate"]),
        (["inference.roi.margin=0"], ["inference.roi.margin: expected a positive number, found 0"]),
    ],
)
def test_a_ladder_that_cannot_stand_is_refused(folder: Path, arguments: list[str], words: list[str]) -> None:
    write_sequence(folder / "tree", "11", range(2), labelled=False)
    message = refused(folder, "oracle", *ORACLE, *arguments)
    assert all(word in message for word in words), message
    assert not (folder / "oracle.json").exists()
    assert not (folder / "tables").exists()


@pytest.mark.parametrize(
    ("command", "arguments", "said"),
    [
        (
            "oracle",
            ["grid=semantickitti_10cm"],
            "grid: expected none with a checkpoint, which has its own, found grid=",
        ),
        ("oracle", ["inference.roi.margin=2"], "inference.roi.margin: expected none with a checkpoint"),
        ("predict", ["input=tree", "split=test"], "split: expected none with input, whose scans belong to no dataset"),
        ("predict", ["input=tree", "dataset.workers=0"], "dataset.workers: expected none with input"),
        ("predict", ["input=tree", "dataset=nuscenes"], "dataset: expected none with input"),
        ("predict", ["scans.period=0.2"], "scans.period: expected none without input=FOLDER"),
    ],
)
def test_settings_that_cannot_act_are_refused(
    folder: Path, checkpoint: Path, command: str, arguments: list[str], said: str
) -> None:
    """Neither the dataset nor the folder of scans is there: it is refused before anything is looked for."""
    message = refused(folder, command, f"checkpoint={checkpoint}", "out=out", *arguments)
    assert said in message
    assert not (folder / "out").exists()


def test_a_ladder_is_not_put_up_against_a_model_of_other_classes(folder: Path, checkpoint: Path) -> None:
    nuscenes_tree.write_tree(folder / "nuscenes", {"scene-0003": True})
    message = refused(folder, "oracle", "dataset=nuscenes", "dataset.root=nuscenes", f"checkpoint={checkpoint}")
    assert "expected one of semantickitti, which the model knows, found one of nuscenes" in message


@pytest.mark.parametrize("command", ["predict", "train"])
def test_files_that_are_no_checkpoints_are_refused(folder: Path, checkpoint: Path, command: str) -> None:
    (folder / "text.ckpt").write_text("no checkpoint")
    (folder / "cut.ckpt").write_bytes(checkpoint.read_bytes()[:5000])
    for name in ("text", "cut", "missing"):
        arguments = PREDICT if command == "predict" else [*TRAIN, "stage=membership"]
        key = "checkpoint" if command == "predict" else "stage1"
        message = refused(folder, command, *arguments, f"{key}={name}.ckpt")
        assert f"{name}.ckpt: expected a checkpoint, found" in message
    assert not (folder / "out").exists()


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ("backbone.widths=[4,4,8,16]", "another backbone"),
        ("grid.voxel_size=[0.4,0.4,0.8]", "another grid"),
        ("dataset.sweeps=1", "another sweeps"),
    ],
)
def test_a_stage_1_of_another_model_is_refused(folder: Path, checkpoint: Path, change: str, what: str) -> None:
    message = refused(folder, "train", *TRAIN, "stage=membership", f"stage1={checkpoint}", change)
    assert f"was trained with {what}: expected" in message
    assert "repeat the settings" in message


def test_a_full_disk_is_said_so_and_leaves_nothing_half_written(folder: Path) -> None:
    message = refused(folder, "train", *TRAIN, largest_file=20_000)
    assert "detection-last.ckpt: expected a place to write the checkpoint" in message
    assert not list((folder / "run" / "checkpoints").glob("*"))


def test_folders_with_other_content_are_refused(folder: Path, checkpoint: Path) -> None:
    message = refused(folder, "predict", *PREDICT, f"checkpoint={checkpoint}", "out=tree")
    assert "tree: expected a new or empty folder, found other files; choose another out" in message
    message = refused(folder, "simulate", "simulation=demo", "out=tree", "simulation.sequences=['00']")
    assert "expected no folder or a simulated sequence, found other files; choose another out" in message
    message = refused(folder, "train", *TRAIN, f"hydra.run.dir={checkpoint.parents[1]}")
    assert "expected a folder of no other run, found" in message
    assert f"resume={checkpoint}" in message


def test_scoring_what_is_not_there_is_refused(folder: Path) -> None:
    assert "out" in refused(folder, "evaluate", *EVALUATE)
    assert not (folder / "metrics.json").exists()


def test_empty_scans_and_non_finite_points_are_no_error(folder: Path, checkpoint: Path) -> None:
    """They are dropped from the input and labelled all the same."""
    sequence = folder / "tree" / "sequences" / "01"
    (sequence / "velodyne/000000.bin").write_bytes(b"")
    (sequence / "labels/000000.label").write_bytes(b"")
    points = np.fromfile(sequence / "velodyne/000001.bin", "<f4").reshape(-1, 4)
    points[0], points[1, 2] = np.nan, np.inf
    points.tofile(sequence / "velodyne/000001.bin")
    done = Command(folder, "predict", *PREDICT, f"checkpoint={checkpoint}").done()
    assert done.returncode == 0, done.stderr
    written = folder / "out" / "sequences" / "01" / "predictions"
    assert (written / "000000.label").stat().st_size == 0
    assert (np.fromfile(written / "000001.label", "<u4") > 0).sum() == len(points)
    done = Command(folder, "train", *TRAIN, "dataset.splits.train=['01']", "dataset.splits.val=['01']").done()
    assert done.returncode == 0, done.stderr
