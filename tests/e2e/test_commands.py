"""The whole way through the real commands, as a newcomer would type them: simulate, train, predict, evaluate, draw."""

import json
from pathlib import Path

import numpy as np
import pytest

from commands import SIMULATE, SPLITS, TRAIN, most
from wandb_run import OfflineRun, read_run

MODEL = "run/checkpoints/membership-last.ckpt"


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    """A folder in which two sequences were simulated and a tiny network was trained."""
    folder = tmp_path_factory.mktemp("run")
    for command, *arguments in [("simulate", *SIMULATE), ("train", *TRAIN, "hydra.run.dir=run")]:
        done = most(folder, command, *arguments)
        assert done.returncode == 0, done.stderr
    return folder


def test_training_leaves_metrics_checkpoints_and_pictures(run):
    report = json.loads((run / "run" / "metrics.json").read_text())
    assert 0 <= report["panoptic"]["pq"] <= 1
    assert {"car", "road"} <= set(report["panoptic"]["per_class"])
    assert report["epochs"] == 2
    assert 0 <= report["panoptic_nearest"]["pq"] <= 1
    kept = sorted(path.name for path in (run / "run" / "checkpoints").iterdir())
    assert kept == ["detection-last.ckpt", "membership-last.ckpt"]
    for stage in ("detection", "membership"):
        assert list((run / "run" / "pictures" / stage).rglob("*.png"))


@pytest.fixture(scope="module")
def logged(run) -> OfflineRun:
    """What that training told W&B."""
    return read_run(run / "run")


def test_the_offline_run_holds_configuration_losses_metrics_rate_and_throughput(logged):
    for key in ("train/loss_heatmap", "train/loss_voxel", "val/pq", "val/miou", "learning_rate", "lr-SGD",
                "train/scans_per_second", "membership/train/loss", "membership/val/pq", "membership/val/nearest_pq",
                "val/class_pq/car"):  # fmt: skip
        assert isinstance(logged.last[key], int | float), key
    assert logged.config["stage"]["membership"]["epochs"] == 2
    assert logged.config["backbone"]["widths"] == [4, 4, 8, 8]
    assert logged.config["choices"]["extent"] == "track_max"
    assert logged.config["overrides"]["stage.membership.epochs"] == "2"


def test_the_offline_run_holds_pictures_tables_and_confusion_matrices(run, logged):
    for name in ("images/val/bev_1_", "images/membership/val/bev_2_", "table/val/per_class_",
                 "table/val/confusion_matrix_table_", "table/membership/val/confusion_matrix_table_"):  # fmt: skip
        assert any(path.startswith(name) for path in logged.media), name
    (confusion,) = (run / "run").rglob("media/table/membership/val/confusion_matrix_table_*.json")
    (per_class,) = (run / "run").rglob("media/table/membership/val/per_class_*.json")
    labelled = sum(points for _, _, points in json.loads(confusion.read_text())["data"])
    seen = sum(
        (np.fromfile(path, "<u4") & 0xFFFF > 0).sum() for path in (run / "streets/sequences/01/labels").iterdir()
    )
    assert 0.9 * seen < labelled <= seen  # outliers are void, too
    report = json.loads((run / "run" / "metrics.json").read_text())["panoptic"]["per_class"]
    assert {row[0]: row[1] for row in json.loads(per_class.read_text())["data"]} == {
        name: figures["pq"] for name, figures in report.items()
    }


def test_the_offline_run_holds_checkpoint_figures_and_settings_as_artifacts(logged):
    assert logged.artifacts.pop("model") == ["membership-last.ckpt"]
    assert logged.artifacts.pop("metrics") == ["metrics.json"]
    assert logged.artifacts.pop("config") == ["config.yaml", "overrides.yaml"]
    assert set(logged.artifacts) <= {"run_table", "job"}  # those that W&B makes of media


def test_every_key_of_the_dashboard_is_one_that_a_training_logs(run, logged):
    done = most(run, "dashboard", "out=dashboard.json")
    assert done.returncode == 0, done.stderr
    said = json.loads((run / "dashboard.json").read_text())
    keys = [key for section in said["sections"] for panel in section["panels"] for key in panel["keys"]]
    assert len(keys) > 40
    of_other_settings = ["train/loss_lovasz", "train/loss_yaw"]  # see test_extents
    assert [key for key in keys if not logged.logged(key)] == of_other_settings
    assert all(name in logged.config["choices"] for name in ("extent", "membership"))
    assert said["grouped_by"] == ["choices.extent", "choices.membership", "choices.heads", "backbone.separate"]


def test_predictions_cover_every_point_and_are_scored(run):
    done = most(run, "predict", f"checkpoint={MODEL}", "split=val", "out=predictions",
                "dataset=simulated", "dataset.root=streets", "dataset.workers=0", *SPLITS)  # fmt: skip
    assert done.returncode == 0, done.stderr
    written = sorted((run / "predictions" / "sequences" / "01" / "predictions").glob("*.label"))
    assert len(written) == 3
    for path in written:
        labels = np.fromfile(path, "<u4")
        scan = run / "streets" / "sequences" / "01" / "velodyne" / f"{path.stem}.bin"
        assert len(labels) == scan.stat().st_size // 16
        raw, ids = labels & 0xFFFF, labels >> 16
        assert (raw > 0).all()
        assert ((ids > 0) == (raw <= 32)).all()  # things have an id, stuff has none

    done = most(run, "evaluate", "predictions=predictions", "split=val", "out=scores.json", "dataset=simulated",
                "dataset.root=streets", *SPLITS)  # fmt: skip
    assert done.returncode == 0, done.stderr
    scores = json.loads((run / "scores.json").read_text())["panoptic"]
    trained = json.loads((run / "run" / "metrics.json").read_text())["panoptic"]
    for name in ("pq", "sq", "rq", "pq_things", "pq_dagger", "miou", "membership_accuracy"):
        assert scores[name] == (trained[name] and pytest.approx(trained[name], abs=1e-6)), name

    done = most(run, "predict", f"checkpoint={MODEL}", "split=val", "out=nearest", "membership=nearest",
                "dataset=simulated", "dataset.root=streets", "dataset.workers=0", *SPLITS)  # fmt: skip
    assert done.returncode == 0, done.stderr
    done = most(run, "evaluate", "predictions=nearest", "split=val", "out=nearest.json", "dataset=simulated",
                "dataset.root=streets", *SPLITS)  # fmt: skip
    assert done.returncode == 0, done.stderr
    nearest = json.loads((run / "nearest.json").read_text())["panoptic"]
    trained = json.loads((run / "run" / "metrics.json").read_text())["panoptic_nearest"]
    assert nearest["pq"] == pytest.approx(trained["pq"], abs=1e-6)

    done = most(run, "compare", "reports={nearest: nearest.json, full: scores.json}")
    assert done.returncode == 0, done.stderr
    figures, differences = done.stdout.split("\n\n")
    assert [line.split()[0] for line in figures.splitlines()] == ["PQ", "nearest", "full"]
    assert differences.startswith("minus nearest")

    done = most(run, "draw", "predictions=predictions", "sequence='01'", "index=1", "out=sweep.png",
                "dataset=simulated", "dataset.root=streets", *SPLITS)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (run / "sweep.png").read_bytes().startswith(b"\x89PNG")


def test_a_split_without_labels_is_predicted_too(run):
    blind = run / "blind" / "sequences" / "11"
    blind.mkdir(parents=True)
    for name in ("velodyne", "calib.txt", "poses.txt", "times.txt"):
        (blind / name).symlink_to(run / "streets" / "sequences" / "01" / name)
    done = most(run, "predict", f"checkpoint={MODEL}", "split=test", "out=blind_predictions",
                "dataset=simulated", "dataset.root=blind", "dataset.workers=0", *SPLITS)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert len(list((run / "blind_predictions").rglob("*.label"))) == 3


def test_scans_of_no_dataset_are_labelled_too(run):
    scans = run / "streets/sequences/01/velodyne"
    done = most(run, "predict", f"checkpoint={MODEL}", f"input={scans}", "out=loose")
    assert done.returncode == 0, done.stderr
    for path in sorted(scans.iterdir()):
        labels = np.fromfile(run / f"loose/predictions/{path.stem}.label", "<u4")
        assert len(labels) == path.stat().st_size // 16
    other = most(run, "predict", f"checkpoint={MODEL}", "input=nowhere", "out=none")
    assert other.returncode == 2
    assert "nowhere: expected a folder of scans, found none" in other.stderr


def test_prediction_goes_on_where_it_stopped_and_refuses_another_models_folder(run):
    arguments = ["split=val", "dataset=simulated", "dataset.root=streets", "dataset.workers=0", *SPLITS]
    assert most(run, "predict", f"checkpoint={MODEL}", "out=again", *arguments).returncode == 0
    labels = sorted((run / "again").rglob("*.label"))
    kept = labels[0].stat().st_mtime_ns
    labels[1].unlink()
    assert most(run, "predict", f"checkpoint={MODEL}", "out=again", *arguments).returncode == 0
    assert labels[1].is_file()
    assert labels[0].stat().st_mtime_ns == kept
    other = most(run, "predict", f"checkpoint={MODEL}", "out=streets", *arguments)
    assert other.returncode == 2
    assert "choose another out" in other.stderr


def test_a_run_goes_on_with_its_own_settings_in_its_own_folder_alone(run):
    arguments = [*TRAIN, f"resume={MODEL}"]
    for change, message in {
        "stage.membership.epochs=3": "began with training.epochs = 2, found 3",
        "encoder.widths=[8,8]": "began with parts.encoder.settings.widths = [8, 4], found [8, 8]",
        "seed=2": "began with seed = 1, found 2",
        "stage.hand_over=last": "run began with stage.hand_over = best, found last",
        "hydra.run.dir=other": "expected the run's own folder, found",
    }.items():
        refused = most(run, "train", *arguments, "hydra.run.dir=run", change)
        assert refused.returncode == 2
        assert message in refused.stderr
    assert not (run / "other" / "metrics.json").exists()


def test_a_missing_dataset_is_one_message_before_any_work(tmp_path):
    done = most(tmp_path, "train", "+experiment=semkitti_max", "dataset.root=nowhere", "hydra.run.dir=run")
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    for hint in ("nowhere/sequences", "velodyne", "most.simulate"):
        assert hint in done.stderr
    assert not (tmp_path / "run" / "checkpoints").exists()


def test_the_oracle_ladder_stands_on_a_model_or_on_none(run):
    arguments = ["split=val", "dataset=simulated", "dataset.root=streets", "dataset.tables=tables", "dataset.workers=0",
                 "dataset.min_points=0", *SPLITS]  # fmt: skip
    for told in (["out=none.json"], ["out=ladder.json", f"checkpoint={MODEL}"]):
        done = most(run, "oracle", *told, *arguments)
        assert done.returncode == 0, done.stderr
        assert "everything, semantics by voxel" in done.stdout
        assert "does not say how heat maps were drawn" not in done.stderr  # stage 2 knows what its stage 1 learned from
        assert all(len(line) <= 120 for line in done.stdout.splitlines())
    none, model = (json.loads((run / f"{name}.json").read_text())["rows"] for name in ("none", "ladder"))
    assert none["everything"] == model["everything"]
    assert none["everything"]["panoptic"]["miou"] == none["ceiling: the truth"]["panoptic"]["miou"]
    top, ceiling = (none[name]["lstq"]["lstq"] for name in ("everything", "ceiling: its instances"))
    assert 0.98 * ceiling <= top <= ceiling  # of two bicycles of a point each one takes the other's track
    assert {"the model", "only centres", "all but extents"} <= model.keys() - none.keys()


def test_the_models_rung_is_what_predict_and_evaluate_say(run):
    arguments = ["split=val", "dataset=simulated", "dataset.root=streets", "dataset.workers=0", *SPLITS]
    assert (
        most(run, "oracle", f"checkpoint={MODEL}", "out=as_is.json", "dataset.tables=tables", *arguments).returncode
        == 0
    )
    assert most(run, "predict", f"checkpoint={MODEL}", "out=as_is", *arguments).returncode == 0
    assert most(run, "evaluate", "predictions=as_is", "out=evaluated.json", *arguments).returncode == 0
    rung = json.loads((run / "as_is.json").read_text())["rows"]["the model"]
    report = json.loads((run / "evaluated.json").read_text())
    assert rung["lstq"] == report["lstq"]
    assert rung["panoptic"] == {key: report["panoptic"][key] for key in rung["panoptic"]}
