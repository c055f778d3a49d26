"""Settings of Lightning's Trainer, and what follows from them."""

from dataclasses import dataclass

import torch

from most.errors import ConfigError

MIXED = ("bf16-mixed", "16-mixed")
PRECISIONS = ("auto", "32-true", *MIXED)
ACCELERATORS = ("auto", "cpu", "gpu")
STRATEGIES = ("auto", "ddp")


@dataclass
class TrainerSettings:
    """On what hardware, how precisely, and how often to look and to save."""

    accelerator: str = "auto"
    devices: int = 1  # processes, a device each; -1 for all devices there are
    strategy: str = "auto"  # ddp: each process has its share of every batch
    precision: str = "32-true"  # as Lightning names it; auto: bf16-mixed on a GPU that has it, else 32-true
    threads: int = 0  # CPU threads of tensor operations; 0 leaves torch's choice
    validate_every: int = 1  # epochs
    log_every: int = 10  # optimiser steps
    save_every: float = 10.0  # minutes between two checkpoints within an epoch
    progress_bar: bool = True

    def __post_init__(self) -> None:
        for key, known in {"accelerator": ACCELERATORS, "strategy": STRATEGIES, "precision": PRECISIONS}.items():
            if getattr(self, key) not in known:
                raise ConfigError(f"trainer.{key}: expected one of {', '.join(known)}, found {getattr(self, key)}")
        for key, lowest in {"threads": 0, "validate_every": 1, "log_every": 1}.items():
            if getattr(self, key) < lowest:
                raise ConfigError(f"trainer.{key}: expected at least {lowest}, found {getattr(self, key)}")

        if self.devices == 0 or self.devices < -1:
            raise ConfigError(f"trainer.devices: expected a positive number, or -1 for all, found {self.devices}")
        if not self.save_every > 0:
            raise ConfigError(f"trainer.save_every: expected minutes above 0, found {self.save_every}")

    def chosen_precision(self) -> str:
        """Return the precision as Lightning names it."""
        if self.precision != "auto":
            return self.precision
        on_gpu = self.accelerator != "cpu" and torch.cuda.is_available()
        return "bf16-mixed" if on_gpu and torch.cuda.is_bf16_supported(including_emulation=False) else "32-true"

    def processes(self) -> int:
        """Return how many processes train together."""
        return self.devices if self.devices > 0 else max(torch.cuda.device_count(), 1)

    def accumulated(self, effective: int, per_process: int, stage: str) -> int:
        """Return how many batches of each process make an effective one of ``effective`` scans."""
        per_step = per_process * self.processes()
        if effective % per_step:
            raise ConfigError(
                f"stage.{stage}.batch_size: expected a multiple of {per_step} (dataset.batch_size = {per_process}, "
                f"{self.processes()} process(es)), found {effective}"
            )
        return effective // per_step
