"""Sweeps through the real commands: killed, continued, with a failing job among them, and refused as a whole."""

import os
import signal
from pathlib import Path

import pytest
import torch

import nuscenes_tree
from commands import SPLITS, TINY, Done, Signal, most
from most.sweeps import by_key, job_name
from semantickitti_tree import write_sequence
from wandb_run import read_run

SETTINGS = ["+experiment=sim_demo", "dataset.root=tree", "dataset.tables=tables", *SPLITS, *TINY, "logger=none",
            "logger.pictures=0", "trainer.progress_bar=false", "stage.detection.epochs=1"]  # fmt: skip
NAMES = [f"extent-{extent}+seed-{seed}" for extent in ("shrink_wrap", "track_max") for seed in (1, 2)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a tree of two sequences of four scans."""
    made = tmp_path_factory.mktemp("sweeps")
    for name in ("00", "01"):
        write_sequence(made / "tree", name, range(4))
    return made


def sweep(folder: Path, *arguments: str, signal: Signal | None = None) -> Done:
    return most(folder, "train", "-m", *SETTINGS, "hydra.sweep.dir=sweep", *arguments, signal=signal)


def jobs(folder: Path) -> dict[str, Path]:
    """The jobs' folders by the beginning of their names."""
    return {path.name.partition("+stage-")[0]: path for path in (folder / "sweep").iterdir() if path.is_dir()}


@pytest.fixture(scope="module")
def killed(folder: Path) -> Path:
    """Two strategies and two seeds, killed in the second job."""
    done = sweep(
        folder, "stage=detection", "extent=shrink_wrap,track_max", "seed=1,2", signal=Signal(signal.SIGKILL, 8)
    )
    assert done.returncode == -signal.SIGKILL
    assert sorted(jobs(folder)) == NAMES[:2]
    return folder


@pytest.fixture(scope="module")
def continued(killed: Path) -> Path:
    """The same by two processes at a time; the third job fails: its checkpoints have no place."""
    pytest.importorskip("hydra_plugins.hydra_joblib_launcher")
    first, second = (jobs(killed)[name] for name in NAMES[:2])
    assert (first / "metrics.json").is_file()
    assert not (second / "metrics.json").exists()
    assert (second / "checkpoints" / "detection-last.ckpt").is_file()
    told = by_key([*SETTINGS, "stage=detection", "extent=track_max", "seed=1"])
    third = first.with_name(job_name([f"{key}={value}" for key, value in told.items()]))
    third.mkdir()
    (third / "checkpoints").touch()
    os.utime(first / "metrics.json", (0, 0))
    arguments = ["stage=detection", "extent=shrink_wrap,track_max", "seed=1,2", "hydra/launcher=processes",
                 "dataset.workers=1"]  # fmt: skip
    done = sweep(killed, *arguments)
    assert done.returncode == 1
    assert "4 jobs, 1 of them finished before" in done.stdout
    assert "1 of 3 jobs failed; repeat the command to try them again" in done.stderr
    assert f"{third.relative_to(killed)}: " in done.stderr
    assert "Traceback" not in done.stderr.partition("most: 1 of 3")[2]
    return killed


def test_a_sweep_goes_on_with_what_is_missing_and_no_job_takes_others_along(continued):
    found = jobs(continued)
    assert sorted(found) == NAMES
    finished = [name for name in NAMES if (found[name] / "metrics.json").is_file()]
    assert finished == [NAMES[0], NAMES[1], NAMES[3]]
    assert (found[NAMES[0]] / "metrics.json").stat().st_mtime == 0  # not touched again
    assert "expected a place to write the checkpoint" in (found[NAMES[2]] / "train.log").read_text()

    (found[NAMES[2]] / "checkpoints").unlink()
    done = sweep(continued, "stage=detection", "extent=shrink_wrap,track_max", "seed=1,2")
    assert done.returncode == 0, done.stderr
    assert "4 jobs, 3 of them finished before" in done.stdout
    weights = [
        torch.load(path / "checkpoints" / "detection-last.ckpt", weights_only=True) for path in jobs(continued).values()
    ]
    assert {each["most_run"]["extent"]["component"] for each in weights} == {"shrink_wrap", "track_max"}
    done = sweep(continued, "stage=detection", "extent=shrink_wrap,track_max", "seed=1,2")
    assert (done.returncode, done.stdout) == (0, "sweep: 4 jobs, 4 of them finished before\n")


def test_memberships_share_one_stage_1_that_a_runs_folder_names(continued):
    """Each seed's own; one membership here, the one that is missing by a process that submitit starts."""
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    (continued / "stage1_1").symlink_to(jobs(continued)[NAMES[2]])
    settings = [setting for setting in SETTINGS if setting != "logger=none"]
    told = [*settings, "hydra.sweep.dir=stage2", "stage=membership", "seed=1", "extent=track_max",
            "stage1=stage1_${seed}"]  # fmt: skip
    for more in (["membership=geometric"], ["membership=geometric,full", "hydra/launcher=submitit_local"]):
        done = most(continued, "train", "-m", *told, *more)
        assert done.returncode == 0, done.stderr
    assert "2 jobs, 1 of them finished before" in done.stdout
    runs = {path.name: read_run(path) for path in (continued / "stage2").glob("extent-*")}
    assert {(run.group, run.name) for run in runs.values()} == {("stage2", name) for name in runs}
    told = [(run.config["choices"]["membership"], run.config["overrides"]["membership"]) for run in runs.values()]
    assert sorted(told) == [("full", "full"), ("geometric", "geometric")]
    made = sorted((continued / "stage2").glob("extent-*/checkpoints/*"))
    assert [path.name for path in made] == ["membership-last.ckpt"] * 2
    networks = [torch.load(path, weights_only=True)["state_dict"] for path in made]
    shared = [name for name in networks[0] if name.startswith("network.")]
    assert shared
    assert all(torch.equal(networks[0][name], networks[1][name]) for name in shared)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("extent=trackmax,track_max", ["extent/trackmax", "shrink_wrap", "track_max"]),
        ("stage.detection.max_rate=1,2", ["max_rate", "expected one of batch_size, ", "max_lr"]),
        ("stage.detection.epochs=1,0", ["job ", "stage.detection.epochs: expected a positive number, found 0"]),
        ("stage=membership stage1={stage1} extent=shrink_wrap backbone=asymmetric_unet_small,residual_unet",
         ["backbone-residual_unet", "was trained with another backbone", "'component': 'asymmetric_unet_small'"]),
        ("stage=membership stage1={stage1} extent=shrink_wrap,track_max",
         ["was trained with another extent: expected", "'component': 'track_max'", "'component': 'shrink_wrap'"]),
        ("stage=membership stage1={stage1} seed=1,2 dataset=nuscenes dataset.root=nuscenes",
         ["was trained with another taxonomy: expected", "'name': 'nuscenes'", "found {'name': 'semantickitti'"]),
    ],
)  # fmt: skip
def test_what_one_job_cannot_do_refuses_the_sweep_before_any_starts(killed, arguments, words):
    stage1 = next(iter((killed / "sweep").glob(f"{NAMES[0]}*")))
    if "nuscenes" in arguments and not (killed / "nuscenes").exists():
        nuscenes_tree.write_tree(killed / "nuscenes", {"scene-0001": True, "scene-0003": True})
    settings = [setting for setting in SETTINGS if "nuscenes" not in arguments or setting not in SPLITS]
    told = arguments.format(stage1=f"'{stage1}'").split()
    done = most(killed, "train", "-m", *settings, "hydra.sweep.dir=refused", *told)
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert all(word in done.stderr for word in words), done.stderr
    assert not (killed / "refused").exists()
