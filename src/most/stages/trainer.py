"""Settings of Lightning's Trainer, and what follows from them."""

from dataclasses import dataclass

from most.errors import ConfigError


@dataclass
class TrainerSettings:
    """On what hardware, how precisely, and how often to look."""

    accelerator: str = "auto"
    devices: int = 1
    nodes: int = 1
    strategy: str = "auto"
    precision: str = "32-true"  # as Lightning names it
    threads: int = 0  # CPU threads of tensor operations; 0 leaves torch's choice
    validate_every: int = 1  # epochs
    log_every: int = 10  # optimiser steps
    progress_bar: bool = True

    def __post_init__(self) -> None:
        for key, lowest in {"devices": 1, "nodes": 1, "threads": 0, "validate_every": 1, "log_every": 1}.items():
            if getattr(self, key) < lowest:
                raise ConfigError(f"trainer.{key}: expected at least {lowest}, found {getattr(self, key)}")

    def accumulated(self, effective: int, per_step: int) -> int:
        """Return how many batches make an effective one of ``effective`` scans."""
        together = per_step * self.devices * self.nodes
        if effective % together:
            raise ConfigError(
                f"stage.batch_size: expected a multiple of dataset.batch_size x trainer.devices x trainer.nodes = "
                f"{together}, found {effective}"
            )
        return effective // together
