"""The real commands, as a user would type them, on sequences and networks small enough for a test."""

import multiprocessing
import os
import resource
import runpy
import subprocess
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path

TINY = [
    "grid.voxel_size=[0.4,0.4,0.4]",
    "backbone.widths=[4,4,8,8]",
    "backbone.bev_channels=8",
    "encoder.widths=[8,4]",
    "heads.centre.channels=8",
    "membership.widths=[4,4]",
    "stage.detection.epochs=2",
    "stage.detection.batch_size=2",
    "stage.membership.epochs=2",
    "stage.membership.batch_size=2",
    "trainer.validate_every=3",  # never during the two epochs: the last weights are scored all the same
    "trainer.threads=1",
    "trainer.log_every=1",
    "dataset.workers=0",
]
SPLITS = ["dataset.splits.train=['00']", "dataset.splits.val=['01']", "dataset.splits.test=['11']"]
SIMULATE = [
    "simulation=demo", "out=streets", "simulation.sequences=['00','01']", "simulation.scans=3",
    "simulation.sensor.columns=256",
]  # fmt: skip
TRAIN = ["+experiment=sim_demo", "dataset.root=streets", "dataset.tables=tables", *SPLITS, *TINY]
SIGNALLED = """
import os, sys
from most import train
from most.entry import start
from most.stages.checkpoints import LastCheckpoint

hook, number, left = sys.argv.pop(1), int(sys.argv.pop(1)), int(sys.argv.pop(1))
end = getattr(LastCheckpoint, hook)

def hook_and_signal(self, *arguments):
    global left
    left -= 1
    if left == 0:
        os.killpg(0, number)  # as a terminal does: the loading processes get it too
    end(self, *arguments)

setattr(LastCheckpoint, hook, hook_and_signal)
start(train.main)
"""


def most(folder: Path, command: str, *arguments: str) -> subprocess.CompletedProcess:
    """Run a command in ``folder``."""
    return python(folder, "-m", f"most.{command}", *arguments)


def signalled(
    folder: Path, number: int, batch: int, *arguments: str, hook: str = "on_train_batch_end"
) -> subprocess.CompletedProcess:
    """Train in ``folder``; at the ``batch``-th call of a hook all its processes get a signal."""
    return python(folder, "-c", SIGNALLED, hook, str(number), str(batch), *arguments)


def python(folder: Path, *arguments: str) -> subprocess.CompletedProcess:
    """Run Python in ``folder``; W&B's own files go there too."""
    places = {f"WANDB_{name}": str(folder / "wandb") for name in ("DIR", "DATA_DIR", "CACHE_DIR", "CONFIG_DIR")}
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder, env=os.environ | places | {"OMP_NUM_THREADS": "1"}, capture_output=True, text=True, check=False,
        start_new_session=True,
    )  # fmt: skip


@dataclass
class Done:
    """How a command ended; ``returncode`` is minus the signal that killed it."""

    returncode: int
    stderr: str


class Forked:
    """A command in a process forked from one that has imported everything: seconds sooner than a new interpreter."""

    def __init__(self, folder: Path, command: str, *arguments: str, largest_file: int | None = None) -> None:
        """Start it in ``folder``, with a limit (bytes) that files run into as into a full disk."""
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["most.train", "most.predict", "most.evaluate", "most.simulate"])
        self.stderr = folder / f"{command}.stderr"
        self.process = context.Process(target=_as_main, args=(folder, command, arguments, self.stderr, largest_file))
        self.process.start()

    def ends_within(self, seconds: float) -> bool:
        """Wait for its end, and kill it where that is not in time."""
        self.process.join(seconds)
        if ended := self.process.exitcode is not None:
            return ended
        self.process.kill()
        self.process.join()
        return False

    def done(self) -> Done:
        """Wait for its end."""
        self.process.join()
        return Done(int(self.process.exitcode or 0), self.stderr.read_text())


def _as_main(folder: Path, command: str, arguments: tuple[str, ...], stderr: Path, largest_file: int | None) -> None:
    os.chdir(folder)
    for number in (1, 2):
        os.dup2(os.open(stderr, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    sys.stdout, sys.stderr = (open(number, "w", closefd=False) for number in (1, 2))  # noqa: SIM115
    os.environ["OMP_NUM_THREADS"] = "1"
    if largest_file is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))
    warnings.simplefilter("ignore", RuntimeWarning)  # of runpy: the module was imported before
    sys.argv = [f"most.{command}", *arguments]
    try:
        runpy.run_module(f"most.{command}", run_name="__main__", alter_sys=True)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
