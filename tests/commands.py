"""The real commands, as a user would type them, on sequences and networks small enough for a test."""

import os
import subprocess
import sys
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
from most.stages.checkpoints import LastCheckpoint

number, left = int(sys.argv.pop(1)), int(sys.argv.pop(1))
end = LastCheckpoint.on_train_batch_end

def on_train_batch_end(self, *arguments):
    global left
    end(self, *arguments)
    left -= 1
    if left == 0:
        os.kill(os.getpid(), number)

LastCheckpoint.on_train_batch_end = on_train_batch_end
train.main()
"""


def most(folder: Path, command: str, *arguments: str) -> subprocess.CompletedProcess:
    """Run a command in ``folder``."""
    return python(folder, "-m", f"most.{command}", *arguments)


def signalled(folder: Path, number: int, batch: int, *arguments: str) -> subprocess.CompletedProcess:
    """Train in ``folder``; the process sends itself a signal at the end of its ``batch``-th batch."""
    return python(folder, "-c", SIGNALLED, str(number), str(batch), *arguments)


def python(folder: Path, *arguments: str) -> subprocess.CompletedProcess:
    """Run Python in ``folder``; W&B's own files go there too."""
    places = {f"WANDB_{name}": str(folder / "wandb") for name in ("DIR", "DATA_DIR", "CACHE_DIR", "CONFIG_DIR")}
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder, env=os.environ | places | {"OMP_NUM_THREADS": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
