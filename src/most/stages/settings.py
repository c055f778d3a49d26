"""Which stages a training runs, and how each is trained."""

from dataclasses import dataclass, field

from most.errors import ConfigError
from most.stages.detection import DetectionTraining
from most.stages.membership import MembershipTraining

STAGES = ("detection", "membership")


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
