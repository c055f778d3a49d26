"""Described pairs of the scans seen last: a step of stage 2 mixes many scans at the cost of a few.

Pairs of one scan resemble each other (they share F_bev, and few instances): steps on a handful of scans are noisy, and
several steps on the same handful forget the scans before.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from most.errors import ConfigError
from most.processes import everyones, processes, rank
from most.structures import OnDevice

ADDING, DRAWING = 1, 2  # random choices of their own


@dataclass
class Mixing:
    """How stage 2 mixes scans; without any kept, a batch's pairs make one step, all of them (the paper's way)."""

    scans: int = 0  # kept; those of the batch are among them
    pairs_per_scan: int = 1024  # kept at most
    steps: int = 8  # of the optimiser, for each batch of scans
    pairs: int = 8192  # drawn at random for each step, over all processes

    def __post_init__(self) -> None:
        for name, lowest in {"scans": 0, "pairs_per_scan": 1, "steps": 1, "pairs": 1}.items():
            if getattr(self, name) < lowest:
                raise ConfigError(
                    f"stage.membership.mixing.{name}: expected at least {lowest}, found {getattr(self, name)}"
                )


@dataclass
class LabelledPairs(OnDevice):
    """Pairs of points and centres whose truth is known."""

    described: Float[Tensor, "pairs features"]  # PointSegMLP.describe
    members: Float[Tensor, "pairs"]  # Y_mem: 1 for members, 0 for others

    def __len__(self) -> int:
        return len(self.members)

    def select(self, keep: Tensor) -> "LabelledPairs":
        """Keep the pairs an index names."""
        return LabelledPairs(self.described[keep], self.members[keep])

    @classmethod
    def cat(cls, parts: "list[LabelledPairs]") -> "LabelledPairs":
        """Join pairs of several scans."""
        return cls(torch.cat([part.described for part in parts]), torch.cat([part.members for part in parts]))


NONE = LabelledPairs(torch.zeros(0, 0), torch.zeros(0))


class PairPool:
    """Holds the same scans' pairs in every process, on the CPU and in half precision.

    What is drawn depends on the seed and on how much was added and drawn before.
    """

    def __init__(self, mixing: Mixing, seed: int) -> None:
        self.mixing, self.seed = mixing, seed
        self.scans: list[LabelledPairs] = []
        self.pairs = NONE  # of all of them
        self.added = self.drawn = 0

    def add(self, scans: list[LabelledPairs]) -> None:
        """Keep some pairs of each of this process' scans, and what the others add at the same time."""
        mine = []
        for scan in scans:
            chosen = self._choose(len(scan), self.mixing.pairs_per_scan, ADDING, self.added, rank())
            some = scan.select(chosen.to(scan.members.device)).to("cpu")
            mine.append(LabelledPairs(some.described.half(), some.members))
            self.added += 1
        self.scans = [*self.scans, *everyones(mine)][-self.mixing.scans :]
        self.pairs = LabelledPairs.cat(self.scans)

    def draw(self) -> LabelledPairs:
        """Return this process' share of the next step's pairs, on the CPU."""
        chosen = self._choose(len(self.pairs), self.mixing.pairs, DRAWING, self.drawn)[rank() :: processes()]
        self.drawn += 1
        some = self.pairs.select(chosen)
        return LabelledPairs(some.described.float(), some.members)

    def _choose(self, count: int, some: int, *turn: int) -> Tensor:
        return torch.from_numpy(np.random.default_rng([self.seed, *turn]).permutation(count)[:some])

    def state(self) -> dict[str, Any]:
        """Return all that going on exactly takes, in plain types."""
        scans = [(scan.described, scan.members) for scan in self.scans]
        return {"scans": scans, "added": self.added, "drawn": self.drawn}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        self.scans = [LabelledPairs(*scan) for scan in state["scans"]]
        self.pairs = LabelledPairs.cat(self.scans) if self.scans else NONE
        self.added, self.drawn = state["added"], state["drawn"]
