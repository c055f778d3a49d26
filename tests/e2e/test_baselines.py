"""The baselines of Tables I and II through the real commands: one word more than the rest of a command."""

import json
from pathlib import Path

import numpy as np
import pytest

from commands import SIMULATE, SPLITS, TRAIN, most

DATA = ["dataset=simulated", "dataset.root=streets", "dataset.workers=0", *SPLITS]
SHORT = ["stage.detection.epochs=1", "stage.membership.epochs=1", "logger=none"]


def do(folder: Path, command: str, *arguments: str) -> str:
    """Run a command that is expected to go well."""
    done = most(folder, command, *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def streets(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("baselines")
    do(folder, "simulate", *SIMULATE)
    return folder


def check_written(folder: Path) -> None:
    """Every thing has an instance, and its instance's detection lies beside it."""
    for path in sorted(folder.glob("sequences/*/predictions/*.label")):
        labels = np.fromfile(path, "<u4")
        raw, ids = labels & 0xFFFF, labels >> 16
        assert ((ids > 0) == (raw <= 32)).all()
        found = np.load(path.parents[1] / "detections" / f"{path.stem}.npz")
        assert (found["assigned"] < len(found["classes"])).all()
        assert np.isnan(found["velocities"]).all()


def test_offset_regression_is_trained_predicted_tracked_and_scored(streets):
    without = [each for each in TRAIN if not each.startswith("membership.")]
    do(streets, "train", *without, *SHORT, "heads=offset_regression", "stage=detection", "hydra.run.dir=offsets")
    trained = json.loads((streets / "offsets/metrics.json").read_text())["panoptic"]
    do(streets, "predict", "checkpoint=offsets/checkpoints/detection-last.ckpt", "out=predictions", *DATA)
    check_written(streets / "predictions")
    do(streets, "evaluate", "predictions=predictions", "out=scores.json", *DATA)
    scores = json.loads((streets / "scores.json").read_text())["panoptic"]
    assert scores["pq"] == pytest.approx(trained["pq"], abs=1e-6)
    do(streets, "oracle", "checkpoint=offsets/checkpoints/detection-last.ckpt", "out=oracle.json", *DATA)
    rows = json.loads((streets / "oracle.json").read_text())["rows"]
    assert rows["the model"]["panoptic"]["pq"] == pytest.approx(trained["pq"], abs=1e-6)

    refused = most(streets, "train", *TRAIN, *SHORT, "heads=offset_regression", "hydra.run.dir=both")
    assert refused.returncode == 2
    assert (
        "expected modal_centres, whose regions stage 2 learns on, found offset_regression; with it say stage=detection"
        in refused.stderr
    )


def test_a_separate_backbone_serves_both_stages_and_clustering_stands_on_it(streets):
    do(streets, "train", *TRAIN, *SHORT, "backbone.separate=true", "extent=shrink_wrap", "hydra.run.dir=separate")
    model = "checkpoint=separate/checkpoints/membership-last.ckpt"
    do(streets, "predict", model, "out=full", *DATA)
    do(streets, "predict", model, "out=clusters", "membership=clustering", "membership.margin=1.5", *DATA)
    check_written(streets / "clusters")
    do(streets, "evaluate", "predictions=clusters", "out=clusters.json", *DATA)
    assert 0 <= json.loads((streets / "clusters.json").read_text())["panoptic"]["pq"] <= 1
    classes = [np.concatenate([np.fromfile(path, "<u4") & 0xFFFF for path in sorted((streets / out).rglob("*.label"))])
               for out in ("full", "clusters")]  # fmt: skip
    assert np.array_equal(*classes)  # a membership changes no class

    other = most(streets, "predict", model, "out=clusters", "membership=clustering", *DATA)
    assert other.returncode == 2
    assert "holds predictions of another checkpoint, membership" in other.stderr
    other = most(streets, "predict", model, "out=other", "membership=full", *DATA)
    assert other.returncode == 2
    assert "membership: expected one without training, such as nearest" in other.stderr
