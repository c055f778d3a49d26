"""A training that is killed or interrupted goes on as if nothing had happened."""

import signal
from pathlib import Path

import pytest
import torch

from commands import SIMULATE, TRAIN, most, signalled

QUIET = ["logger=none", "logger.pictures=0", "trainer.progress_bar=false"]
OFTEN = "trainer.save_every=0.00001"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Simulated streets, and a training of both stages from beginning to end: 3 batches an epoch, 2 epochs a stage."""
    made = tmp_path_factory.mktemp("interruptions")
    assert most(made, "simulate", *SIMULATE).returncode == 0
    done = most(made, "train", *TRAIN, *QUIET, "hydra.run.dir=whole")
    assert done.returncode == 0, done.stderr
    return made


def weights(folder: Path, stage: str) -> dict[str, torch.Tensor]:
    return torch.load(folder / "checkpoints" / f"{stage}-last.ckpt", weights_only=True)["state_dict"]


def assert_same_as_uninterrupted(folder: Path, run: str) -> None:
    for stage in ("detection", "membership"):
        whole, found = weights(folder / "whole", stage), weights(folder / run, stage)
        assert whole.keys() == found.keys()
        assert all(torch.equal(value, found[name]) for name, value in whole.items()), stage
    assert (folder / run / "metrics.json").read_bytes() == (folder / "whole" / "metrics.json").read_bytes()


@pytest.mark.parametrize(("stage", "batch"), [("detection", 5), ("detection", 3), ("membership", 10)])
def test_after_sigkill_a_resumed_run_ends_with_the_same_weights(folder: Path, stage: str, batch: int) -> None:
    run = f"killed_{batch}"
    arguments = [*TRAIN, *QUIET, OFTEN, f"hydra.run.dir={run}"]
    assert signalled(folder, signal.SIGKILL, batch, *arguments).returncode == -signal.SIGKILL
    done = most(folder, "train", *arguments, f"resume={run}/checkpoints/{stage}-last.ckpt")
    assert done.returncode == 0, done.stderr
    assert_same_as_uninterrupted(folder, run)


def test_sigint_lets_the_step_end_saves_and_says_how_to_go_on(folder: Path) -> None:
    arguments = [*TRAIN, *QUIET, "hydra.run.dir=stopped"]
    stopped = signalled(folder, signal.SIGINT, 4, *arguments)
    assert stopped.returncode == 130
    assert "Traceback" not in stopped.stderr
    assert "repeat the command with resume=" in stopped.stderr
    told = stopped.stderr.split("repeat the command with ")[1].split()
    done = most(folder, "train", *arguments[:-1], *told)
    assert done.returncode == 0, done.stderr
    assert_same_as_uninterrupted(folder, "stopped")
