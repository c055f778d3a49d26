"""Callbacks of every stage."""

import time
from typing import Any

import lightning as L
from lightning.pytorch.callbacks import Callback


class Throughput(Callback):
    """Logs ``train/scans_per_second``, loading included."""

    def __init__(self, prefix: str = "") -> None:
        self.prefix = prefix
        self.since: float | None = None

    def on_train_epoch_start(self, *_: Any) -> None:
        """Forget the time that validation took."""
        self.since = None

    def on_train_batch_end(
        self, trainer: L.Trainer, pl_module: L.LightningModule, outputs: Any, batch: Any, batch_idx: int
    ) -> None:
        """Time one batch from the end of the one before."""
        now = time.perf_counter()
        if self.since is not None:
            rate = len(batch) * trainer.world_size / (now - self.since)
            pl_module.log(f"{self.prefix}train/scans_per_second", rate, batch_size=1)
        self.since = now
