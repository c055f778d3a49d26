"""The extent strategies that need more than a sweep's points, through the real commands."""

import json
import signal
from pathlib import Path

import numpy as np
import pytest
import torch

from commands import SIMULATE, SPLITS, TRAIN, Signal, most
from wandb_run import read_run

DATASET = ["dataset=simulated", "dataset.root=streets", *SPLITS]
NO_PICTURES = ["logger.pictures=0"]
EVERY_LOSS = ["extent=amodal", "stage.detection.losses.lovasz=1"]
QUIET = ["logger=none", *NO_PICTURES]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two simulated streets."""
    made = tmp_path_factory.mktemp("extents")
    done = most(made, "simulate", *SIMULATE)
    assert done.returncode == 0, done.stderr
    return made


def succeed(folder: Path, *arguments: str) -> str:
    """Run a command; return what it printed."""
    done = most(folder, *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_amodal_boxes_are_trained_for_predicted_scored_and_drawn(folder: Path) -> None:
    succeed(folder, "train", *TRAIN, *NO_PICTURES, *EVERY_LOSS, "hydra.run.dir=amodal")
    check_dashboard(folder)
    model = folder / "amodal/checkpoints/membership-last.ckpt"
    saved = torch.load(model, weights_only=True)
    assert saved["most"]["parts"]["centre_head"]["component"] == "oriented_centre_head"
    assert saved["state_dict"]["network.centre_head.regression.weight"].shape[0] == 10

    succeed(folder, "predict", f"checkpoint={model}", "split=val", "out=boxed", "dataset.workers=0", *DATASET)
    beside = list((folder / "boxed").rglob("detections/*.npz"))
    assert len(beside) == 3
    for path in beside:
        with np.load(path) as arrays:
            assert arrays["yaws"].shape == arrays["scores"].shape
            assert (np.abs(arrays["yaws"]) <= np.pi / 2 + 1e-6).all()
    succeed(folder, "evaluate", "predictions=boxed", "split=val", "out=boxed.json", *DATASET)
    scored = json.loads((folder / "boxed.json").read_text())["panoptic"]
    trained = json.loads((folder / "amodal/metrics.json").read_text())["panoptic"]
    for name in ("pq", "membership_accuracy"):
        assert scored[name] == (trained[name] and pytest.approx(trained[name], abs=1e-6)), name
    succeed(folder, "draw", "predictions=boxed", "sequence='01'", "index=1", "out=boxed.png", *DATASET)

    ladder = ["oracle", f"checkpoint={model}", "split=val", "dataset.tables=tables", "dataset.workers=0", *DATASET]
    for name, told in {"own": [], "amodal": ["extent=amodal"], "track_max": ["extent=track_max"]}.items():
        succeed(folder, *ladder, *told, f"out=as_{name}.json")
    own, same, tracks = (
        json.loads((folder / f"as_{name}.json").read_text()) for name in ("own", "amodal", "track_max")
    )
    assert own == same
    assert (own["extent"]["component"], tracks["extent"]["component"]) == ("amodal", "track_max")

    other = most(folder, "train", *TRAIN, *QUIET, "stage=membership", f"stage1={model}", "hydra.run.dir=other")
    assert other.returncode == 2
    assert "was trained with another centre_head" in other.stderr


def check_dashboard(folder: Path) -> None:
    """The training told W&B every key that the dashboard shows, those of its pictures aside."""
    succeed(folder, "dashboard", "out=dashboard.json", "pictures=0")
    sections, logged = json.loads((folder / "dashboard.json").read_text())["sections"], read_run(folder / "amodal")
    keys = [key for section in sections for panel in section["panels"] for key in panel["keys"]]
    assert {"train/loss_yaw", "train/loss_lovasz"} <= {*keys}
    assert [key for key in keys if not logged.logged(key)] == []


def test_the_oracle_knows_amodal_boxes(folder: Path) -> None:
    """With everything from the truth, a turned box is as good a region as one of the track's points."""
    arguments = ["split=val", "grid=semantickitti_10cm", "dataset.tables=tables", "dataset.workers=0", *DATASET]
    figures = {}
    for extent in ("amodal", "track_max"):
        succeed(folder, "oracle", f"extent={extent}", f"out={extent}.json", *arguments)
        rows = json.loads((folder / f"{extent}.json").read_text())["rows"]
        figures[extent] = rows["all but membership"]["panoptic"]["pq_things"], rows["everything"]["panoptic"]["pq"]
    assert figures["amodal"][1] == pytest.approx(figures["track_max"][1], abs=0.02)
    assert figures["amodal"] != figures["track_max"]


def test_class_means_are_the_same_for_a_run_that_goes_on(folder: Path) -> None:
    """They are in no checkpoint: the training split's tables tell them again."""
    run = ["train", *TRAIN, *QUIET, "extent=class_mean", "stage=detection"]
    succeed(folder, *run, "hydra.run.dir=whole")
    stopped = most(folder, *run, "hydra.run.dir=halves", signal=Signal(signal.SIGINT, 2))
    assert stopped.returncode == 130, stopped.stderr
    succeed(folder, *run, *stopped.stderr.split("repeat the command with ")[1].split())
    last = "checkpoints/detection-last.ckpt"
    whole, halves = (torch.load(folder / name / last, weights_only=True)["state_dict"] for name in ("whole", "halves"))
    assert whole.keys() == halves.keys()
    assert all(torch.equal(value, halves[name]) for name, value in whole.items())
