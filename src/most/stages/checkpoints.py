"""Checkpoints that a run goes on from exactly: after an epoch, every few minutes, and when it is interrupted.

They are taken between two optimiser steps, so that no accumulated gradient is lost, and written beside and renamed.
"""

import signal
import threading
import time
from pathlib import Path
from types import FrameType
from typing import Any

import lightning as L
import torch
from lightning.fabric.plugins.io.torch_io import TorchCheckpointIO
from lightning.pytorch.callbacks import Callback, ModelCheckpoint
from torch import distributed

from most.errors import DataError, StoppedError
from most.files import atomic_write

SIGNALS = (signal.SIGINT, signal.SIGTERM)
GO_ON, SAVE, STOP = range(3)


class AtomicCheckpointIO(TorchCheckpointIO):
    """A killed run, or a full disk, leaves the checkpoint that was there before."""

    def save_checkpoint(self, checkpoint: dict[str, Any], path: str | Path, storage_options: Any = None) -> None:
        """Write a checkpoint; DataError where that is impossible."""
        try:
            with atomic_write(Path(path)) as file:
                torch.save(checkpoint, file)
        except (OSError, RuntimeError) as error:  # torch's writer turns a full disk into the latter
            raise DataError(f"{path}: expected a place to write the checkpoint, found {error}; make room") from error


class BestCheckpoint(ModelCheckpoint):
    """Keeps the weights that were best on the validation split at ``path``, to be used, not to be gone on from.

    A run goes on in a folder that was moved, too: the best stays the best.
    """

    def __init__(self, path: Path, figure: str) -> None:
        """``figure`` is the logged key that is to be high."""
        super().__init__(
            path.parent,
            path.stem,
            monitor=figure,
            mode="max",
            save_weights_only=True,
            save_on_train_epoch_end=False,
            enable_version_counter=False,
        )

    @property
    def state_key(self) -> str:
        """As Lightning's own class has it: runs that began with that go on."""
        return super().state_key.replace(type(self).__qualname__, ModelCheckpoint.__qualname__, 1)

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Take up what was reached; Lightning would forget it where the folder is another."""
        files = ("best_model_path", "kth_best_model_path", "last_model_path")
        moved = {name: self._here(state_dict[name]) for name in files}
        scores = {self._here(path): score for path, score in state_dict["best_k_models"].items()}
        super().load_state_dict({**state_dict, **moved, "best_k_models": scores, "dirpath": self.dirpath})

    def _here(self, path: str) -> str:
        return str(Path(str(self.dirpath)) / Path(path).name) if path else path


class LastCheckpoint(Callback):
    """Keeps the newest state of a stage at ``path``.

    The first SIGINT or SIGTERM lets the step end, saves, and raises ``StoppedError``; the second is as abrupt as ever.
    """

    def __init__(self, path: Path, minutes: float) -> None:
        """``minutes`` between two checkpoints within an epoch."""
        self.path = path
        self.seconds = 60 * minutes
        self.saved = 0.0
        self.asked = 0  # the signal that came, if one did
        self.former: dict[int, Any] = {}

    def on_train_start(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Listen for signals."""
        self.saved = time.monotonic()
        if threading.current_thread() is threading.main_thread():
            self.former = {number: signal.signal(number, self._ask) for number in SIGNALS}

    def on_train_batch_end(
        self, trainer: L.Trainer, pl_module: L.LightningModule, outputs: Any, batch: Any, batch_idx: int
    ) -> None:
        """Save when it is time to, and before an epoch's last step: going on repeats that and the validation."""
        if (batch_idx + 1) % trainer.accumulate_grad_batches or trainer.is_last_batch:
            return
        last_step_next = trainer.num_training_batches - (batch_idx + 1) <= trainer.accumulate_grad_batches
        due = last_step_next or time.monotonic() - self.saved > self.seconds
        wish = _highest(trainer, STOP if self.asked else SAVE if due else GO_ON)
        if wish != GO_ON:
            self._save(trainer)
        if wish == STOP:
            self._stop(trainer)

    def on_validation_batch_end(self, trainer: L.Trainer, *_: Any) -> None:
        """Stop between two sweeps.

        Several processes stop at the epoch's end instead: their shares of the sweeps may be uneven.
        """
        if trainer.state.fn == "fit" and self.asked and trainer.world_size == 1:
            self._stop(trainer)

    def on_train_epoch_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Keep what the epoch reached."""
        self._save(trainer)
        if _highest(trainer, STOP if self.asked else GO_ON) == STOP:
            self._stop(trainer)

    def on_exception(self, trainer: L.Trainer, pl_module: L.LightningModule, exception: BaseException) -> None:
        """Leave signals as they were: other jobs of a sweep run in this process."""
        self.teardown(trainer, pl_module, "fit")

    def teardown(self, trainer: L.Trainer, pl_module: L.LightningModule, stage: str) -> None:
        """Leave signals as they were."""
        for number, handler in self.former.items():
            signal.signal(number, handler)
        self.former = {}

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = number
        print("\nmost: stopping after this step; once more to stop at once", flush=True)

    def _save(self, trainer: L.Trainer) -> None:
        trainer.save_checkpoint(self.path, weights_only=False)
        self.saved = time.monotonic()

    def _stop(self, trainer: L.Trainer) -> None:
        if not trainer.is_global_zero:
            raise SystemExit(0)  # one message is enough, and a failing child would be the end of the first process
        goes_on = f"resume={self.path} hydra.run.dir={self.path.parents[1]}" if self.path.is_file() else "nothing added"
        raise StoppedError(
            f"interrupted; to go on, repeat the command with {goes_on}", 128 + (self.asked or signal.SIGTERM)
        )


def _highest(trainer: L.Trainer, wish: int) -> int:
    """The most urgent wish of any process: all of them save together."""
    if trainer.world_size == 1:
        return wish
    wishes = torch.tensor(wish, device=trainer.strategy.root_device)
    distributed.all_reduce(wishes, distributed.ReduceOp.MAX)
    return int(wishes)
