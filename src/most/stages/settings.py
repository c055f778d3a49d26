"""Which stages a training runs, and how each is trained; Lightning, which takes seconds to load, is not needed here."""

from dataclasses import dataclass, field

from most.errors import ConfigError
from most.losses import LossWeights
from most.membership import Mixing
from most.modal.heatmap import HeatmapTargets

STAGES = ("detection", "membership")


@dataclass
class DetectionTraining:
    """Optimiser, schedule and losses of stage 1; the defaults are the paper's."""

    optimizer: str = "adam"
    max_lr: float = 1e-3
    weight_decay: float = 0.01
    warm_up: float = 0.4  # share of the steps in which the rate rises (one-cycle)
    initial_divisor: float = 10.0  # the rate starts at max_lr / initial_divisor
    clip: float = 35.0  # norm of the gradient
    batch_size: int = 8  # effective: scans an optimiser step, over all accumulated batches
    epochs: int = 20
    targets: HeatmapTargets = field(default_factory=HeatmapTargets)
    losses: LossWeights = field(default_factory=LossWeights)

    def __post_init__(self) -> None:
        if self.optimizer not in ("adam", "adamw"):
            raise ConfigError(f"stage.detection.optimizer: expected adam or adamw, found {self.optimizer}")
        if not 0 < self.warm_up < 1:
            raise ConfigError(f"stage.detection.warm_up: expected a share in (0, 1), found {self.warm_up}")
        for name in ("max_lr", "initial_divisor", "clip", "batch_size", "epochs"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"stage.detection.{name}: expected a positive number, found {getattr(self, name)}")
        if not self.weight_decay >= 0:
            raise ConfigError(f"stage.detection.weight_decay: expected a number >= 0, found {self.weight_decay}")


@dataclass
class MembershipTraining:
    """Optimiser and length of stage 2; the defaults are the paper's."""

    lr: float = 5e-4
    momentum: float = 0.9
    batch_size: int = 8  # scans that stage 1 sees before the optimiser steps, over all processes
    epochs: int = 20
    mixing: Mixing = field(default_factory=Mixing)
    average: float = 0.0  # decay, each step, of the weights' running mean, which predicts; 0: the last weights do

    def __post_init__(self) -> None:
        for name in ("lr", "batch_size", "epochs"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"stage.membership.{name}: expected a positive number, found {getattr(self, name)}")
        if 0 < self.mixing.scans < self.batch_size:
            raise ConfigError(
                f"stage.membership.mixing.scans: expected 0, or at least stage.membership.batch_size = "
                f"{self.batch_size}, found {self.mixing.scans}"
            )
        for name in ("momentum", "average"):
            if not 0 <= getattr(self, name) < 1:
                raise ConfigError(f"stage.membership.{name}: expected a number in [0, 1), found {getattr(self, name)}")


@dataclass
class StageSettings:
    """Stage 1 (detection and semantics), stage 2 (membership), or one after the other."""

    run: list[str] = field(default_factory=lambda: list(STAGES))
    hand_over: str = "best"  # the weights of stage 1 that stage 2 gets: best on the validation split, or last
    detection: DetectionTraining = field(default_factory=DetectionTraining)
    membership: MembershipTraining = field(default_factory=MembershipTraining)

    def __post_init__(self) -> None:
        if not self.run or [name for name in STAGES if name in self.run] != self.run:
            raise ConfigError(f"stage.run: expected {', '.join(STAGES)}, or both in this order, found {self.run}")
        if self.hand_over not in ("best", "last"):
            raise ConfigError(f"stage.hand_over: expected best or last, found {self.hand_over}")
