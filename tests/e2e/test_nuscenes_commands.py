"""The whole way on nuScenes' layout, through the real commands: simulate, train, predict, evaluate, submit."""

import json
import zipfile
from pathlib import Path

import pytest

from commands import TINY, most

SCENES = {"val": "scene-0003", "test": "scene-0077"}
SIMULATE = [
    "simulation=nuscenes", "out=nuscenes", "simulation.sequences=[scene-0001,scene-0003,scene-0077]",
    "simulation.scans=11", "simulation.sensor.columns=128",
]  # fmt: skip
TREE = ["dataset=nuscenes", "dataset.root=nuscenes"]
MODEL = "run/checkpoints/membership-last.ckpt"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene for each split, of two key frames; a model trained on one; predictions of the others."""
    made = tmp_path_factory.mktemp("nuscenes")
    train = ["+experiment=nuscenes_max", "dataset.root=nuscenes", "dataset.tables=tables", "dataset.sweeps=2", *TINY,
             "logger=none", "hydra.run.dir=run"]  # fmt: skip
    commands = [["simulate", *SIMULATE], ["train", *train]]
    for split, version in {"val": "v1.0-trainval", "test": "v1.0-test"}.items():
        told = [f"split={split}", f"dataset.version={version}", f"out={split}", f"checkpoint={MODEL}"]
        commands.append(["predict", *TREE, *told, "dataset.workers=0"])
    for command in commands:
        done = most(made, *command)
        assert done.returncode == 0, done.stderr
    return made


def test_predictions_are_scored_with_the_devkits_figures(folder: Path) -> None:
    done = most(folder, "evaluate", *TREE, "predictions=val", "split=val", "out=metrics.json")
    assert done.returncode == 0, done.stderr
    report = json.loads((folder / "metrics.json").read_text())
    assert report["scans"] == 2
    assert {"pat", "tq", "ptq", "sptq", "lstq", "s_assoc", "per_class"} <= report["tracking"].keys()
    assert report["panoptic"]["per_class"].keys() >= {"car", "driveable_surface"}
    assert report["panoptic"]["membership_accuracy"] is None or 0 <= report["panoptic"]["membership_accuracy"] <= 1
    for title in ("panoptic segmentation (Tables III, IV)", "4D panoptic segmentation (Table V)", "PQ by class"):
        assert title in done.stdout
    assert all(len(line) <= 120 for line in done.stdout.splitlines())


def test_the_oracle_ladder_has_the_devkits_figures(folder: Path) -> None:
    done = most(folder, "oracle", *TREE, "grid=nuscenes", "dataset.tables=tables", "dataset.workers=0",
                "dataset.min_points=0", "out=ladder.json")  # fmt: skip
    assert done.returncode == 0, done.stderr
    rows = json.loads((folder / "ladder.json").read_text())["rows"]
    top, ceiling = rows["everything"], rows["ceiling: the truth"]
    assert top["panoptic"]["pq"] == ceiling["panoptic"]["pq"]
    assert top["tracking"]["pat"] >= 0.99 * ceiling["tracking"]["pat"]
    assert "PAT rep." in done.stdout


@pytest.mark.parametrize(("split", "version"), [("val", "v1.0-trainval"), ("test", "v1.0-test")])
def test_predictions_are_packaged_as_the_server_expects(folder: Path, split: str, version: str) -> None:
    told = [
        f"predictions={split}",
        f"split={split}",
        f"dataset.splits.{split}=[{SCENES[split]}]",
        f"dataset.version={version}",
        f"out={split}.zip",
    ]
    done = most(folder, "submit", *TREE, *told)
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(folder / f"{split}.zip") as archive:
        names = archive.namelist()
    assert sum(name.startswith(f"panoptic/{split}/") and name.endswith("_panoptic.npz") for name in names) == 2
    assert f"{split}/submission.json" in names


def test_a_package_with_a_scan_missing_is_refused_by_name(folder: Path, tmp_path: Path) -> None:
    done = most(folder, "submit", *TREE, f"predictions={tmp_path}", "split=val", "out=none.zip",
                "dataset.splits.val=[scene-0003]")  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("expected panoptic labels, found no file") == 2
    assert "Traceback" not in done.stderr
    assert not (folder / "none.zip").exists()
