"""A training that is killed or interrupted goes on as if nothing had happened."""

import signal
from pathlib import Path

import pytest
import torch

from commands import SIMULATE, TRAIN, Signal, most

ARGUMENTS = [*TRAIN, "logger=none", "logger.pictures=0", "trainer.progress_bar=false", "trainer.validate_every=1"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Simulated streets, and a training of both stages from beginning to end: 2 epochs a stage, of 3 and 2 batches."""
    made = tmp_path_factory.mktemp("interruptions")
    assert most(made, "simulate", *SIMULATE).returncode == 0
    done = most(made, "train", *ARGUMENTS, "hydra.run.dir=whole")
    assert done.returncode == 0, done.stderr
    return made


def assert_same_as_uninterrupted(folder: Path, run: str) -> None:
    names = [path.name for path in (folder / "whole/checkpoints").iterdir()]
    assert sorted(path.name for path in (folder / run / "checkpoints").iterdir()) == sorted(names)
    for name in names:
        whole, found = (
            torch.load(folder / each / "checkpoints" / name, weights_only=True)["state_dict"] for each in ("whole", run)
        )
        assert whole.keys() == found.keys()
        assert all(torch.equal(value, found[key]) for key, value in whole.items()), name
    assert (folder / run / "metrics.json").read_bytes() == (folder / "whole" / "metrics.json").read_bytes()


@pytest.mark.parametrize(("stage", "batch"), [("detection", 6), ("detection", 4), ("membership", 10)])
def test_after_sigkill_a_resumed_run_ends_with_the_same_weights(folder: Path, stage: str, batch: int) -> None:
    """Killed after the checkpoint within the second epoch, and after the one that the first epoch left."""
    run = f"killed_{batch}"
    arguments = [*ARGUMENTS, f"hydra.run.dir={run}"]
    killed = most(folder, "train", *arguments, signal=Signal(signal.SIGKILL, batch))
    assert killed.returncode == -signal.SIGKILL
    done = most(folder, "train", *arguments, f"resume={run}/checkpoints/{stage}-last.ckpt")
    assert done.returncode == 0, done.stderr
    assert_same_as_uninterrupted(folder, run)


def test_sigint_ends_with_a_checkpoint_and_says_how_to_go_on_as_often_as_it_comes(folder: Path) -> None:
    """In a step, in a validation, and in the last step of an epoch."""
    arguments, told = [*ARGUMENTS, "dataset.workers=1"], ["hydra.run.dir=stopped"]
    for hook, call in (("on_train_batch_end", 2), ("on_validation_batch_end", 1), ("on_train_batch_end", 1)):
        stopped = most(folder, "train", *arguments, *told, signal=Signal(signal.SIGINT, call, hook))
        assert stopped.returncode == 130, stopped.stderr
        assert "Traceback" not in stopped.stderr
        told = stopped.stderr.split("repeat the command with ")[1].split()
    done = most(folder, "train", *arguments, *told)
    assert done.returncode == 0, done.stderr
    assert_same_as_uninterrupted(folder, "stopped")
