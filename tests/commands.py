"""The real commands, as a user would type them, on sequences and networks small enough for a test."""

import itertools
import multiprocessing
import os
import resource
import runpy
import subprocess
import sys
import threading
import warnings
from dataclasses import dataclass
from pathlib import Path

import torch

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
COMMANDS = (
    "train",
    "predict",
    "track",
    "evaluate",
    "compare",
    "submit",
    "simulate",
    "draw",
    "oracle",
    "velocity",
    "report",
    "dashboard",
)
PRELOADED = [f"most.{command}" for command in COMMANDS]


@dataclass
class Done:
    """How a command ended; ``returncode`` is minus the signal that killed it."""

    returncode: int
    stdout: str
    stderr: str


@dataclass(frozen=True)
class Signal:
    """Sent to all processes of a training, as a terminal does, at the ``call``-th call of a hook of its checkpoints."""

    number: int
    call: int
    hook: str = "on_train_batch_end"

    def arm(self) -> None:
        """Wait for the call in this process."""
        from most.stages.checkpoints import LastCheckpoint  # in the process that it concerns

        end, calls = getattr(LastCheckpoint, self.hook), itertools.count(1)

        def signal_and_end(callback: object, *arguments: object) -> None:
            if next(calls) == self.call:
                os.killpg(0, self.number)
            end(callback, *arguments)

        setattr(LastCheckpoint, self.hook, signal_and_end)


class Command:
    """A running command, forked from a process that has imported everything: many seconds sooner than a new one."""

    def __init__(
        self, folder: Path, command: str, *arguments: str, largest_file: int | None = None, signal: Signal | None = None
    ) -> None:
        """Start it in ``folder``, with a limit (bytes) that files run into as into a full disk."""
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(PRELOADED)
        self.said = [folder.parent / f"{folder.name}.{command}.{kind}" for kind in ("stdout", "stderr")]
        self.process = context.Process(
            target=_as_main, args=(folder, command, arguments, self.said, largest_file, signal)
        )
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
        return Done(int(self.process.exitcode or 0), *(path.read_text() for path in self.said))


def most(folder: Path, command: str, *arguments: str, signal: Signal | None = None) -> Done:
    """Run a command in ``folder`` to its end."""
    return Command(folder, command, *arguments, signal=signal).done()


def most_anew(folder: Path, command: str, *arguments: str) -> Done:
    """Run a command in ``folder`` in an interpreter of its own, as a shell does."""
    done = subprocess.run(
        [sys.executable, "-m", f"most.{command}", *arguments],
        cwd=folder, env=os.environ | _environment(folder), capture_output=True, text=True, check=False,
        start_new_session=True,
    )  # fmt: skip
    return Done(done.returncode, done.stdout, done.stderr)


def _environment(folder: Path) -> dict[str, str]:
    """W&B's own files go to the folder, too."""
    places = {f"WANDB_{name}": str(folder / "wandb") for name in ("DIR", "DATA_DIR", "CACHE_DIR", "CONFIG_DIR")}
    return places | {"OMP_NUM_THREADS": "1"}


def _as_main(
    folder: Path,
    command: str,
    arguments: tuple[str, ...],
    said: list[Path],
    largest_file: int | None,
    signal: Signal | None,
) -> None:
    multiprocessing.set_start_method(None, force=True)  # what it starts, it starts as it would from a shell
    os.setsid()  # signals to the group reach this command's processes alone
    os.chdir(folder)
    os.environ |= _environment(folder)
    torch.set_num_threads(1)
    for number, path in enumerate(said, start=1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    sys.stdout, sys.stderr = (open(number, "w", closefd=False) for number in (1, 2))  # noqa: SIM115
    if largest_file is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))
    if signal is not None:
        signal.arm()
    warnings.simplefilter("ignore", RuntimeWarning)  # of runpy: the module was imported before
    sys.argv = [f"most.{command}", *arguments]
    try:
        runpy.run_module(f"most.{command}", run_name="__main__", alter_sys=True)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        threading._shutdown()  # as an interpreter's end does, before it waits for processes: joblib's end by this
