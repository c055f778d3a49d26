"""Settings of Lightning's Trainer, and what follows from them."""

from dataclasses import dataclass

from most.errors import ConfigError

PRECISIONS = ("32-true", "bf16-mixed", "16-mixed")
ACCELERATORS = ("auto", "cpu", "gpu")


@dataclass
class TrainerSettings:
    """On what hardware, how precisely, and how often to look. One process, one device."""

    accelerator: str = "auto"
    precision: str = "32-true"  # as Lightning names it
    threads: int = 0  # CPU threads of tensor operations; 0 leaves torch's choice
    validate_every: int = 1  # epochs
    log_every: int = 10  # optimiser steps
    progress_bar: bool = True

    def __post_init__(self) -> None:
        for key, known in {"accelerator": ACCELERATORS, "precision": PRECISIONS}.items():
            if getattr(self, key) not in known:
                raise ConfigError(f"trainer.{key}: expected one of {', '.join(known)}, found {getattr(self, key)}")
        for key, lowest in {"threads": 0, "validate_every": 1, "log_every": 1}.items():
            if getattr(self, key) < lowest:
                raise ConfigError(f"trainer.{key}: expected at least {lowest}, found {getattr(self, key)}")

    @staticmethod
    def accumulated(effective: int, per_step: int, stage: str) -> int:
        """Return how many batches make an effective one of ``effective`` scans."""
        if effective % per_step:
            raise ConfigError(
                f"stage.{stage}.batch_size: expected a multiple of dataset.batch_size = {per_step}, found {effective}"
            )
        return effective // per_step
