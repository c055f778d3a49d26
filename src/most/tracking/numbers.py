"""The numbers of tracks: unique, and no larger than a label has room for."""

from collections import deque
from collections.abc import Iterable
from typing import Any

import torch
from jaxtyping import Int64
from torch import Tensor

from most.errors import DataError, check_kept

State = tuple[Int64[Tensor, "kinds 2"], Int64[Tensor, "free 2"]]


class Numbers:
    """Gives numbers from 1 up, of each class or of all together.

    When they run out, that whose track died longest ago is used again; where every number lives, the largest is
    shared. No more than ``largest`` numbers of a class are remembered, however many tracks there were.
    """

    def __init__(self, largest: int, by_class: bool) -> None:
        self.largest, self.by_class = largest, by_class
        self._given: dict[int, int] = {}  # the largest number given yet
        self._free: dict[int, deque[int]] = {}  # numbers of dead tracks, the longest dead first

    def take(self, thing: int) -> int:
        """Return the number of a new track of a class."""
        kind = self._kind(thing)
        given = self._given.setdefault(kind, 0)
        if given < self.largest:
            self._given[kind] = given + 1
            return given + 1
        free = self._free.get(kind)
        return free.popleft() if free else self.largest

    def release(self, dead: Iterable[tuple[int, int]], alive: Iterable[tuple[int, int]]) -> None:
        """Take back the (class, number) of tracks that died; one that an ``alive`` track shares stays in use."""
        used = {(self._kind(thing), number) for thing, number in alive}
        for kind, number in dict.fromkeys((self._kind(thing), number) for thing, number in dead):
            if (kind, number) not in used:
                self._free.setdefault(kind, deque()).append(number)

    def state(self) -> State:
        """Return what was given and what is free, in plain tensors; by class, whichever had a number first."""
        given = sorted(self._given.items())
        free = [(kind, number) for kind, numbers in sorted(self._free.items()) for number in numbers]
        return _table(given), _table(free)

    def restore(self, state: tuple[Any, Any]) -> None:
        """Go on from ``state``; a DataError for what is none, or another dataset's, changes nothing."""
        for name, table in zip(("given", "free"), state, strict=True):
            check_kept(name, table, _table([]), len(table))
        given, free = state[0].tolist(), state[1].tolist()
        if any(number > self.largest for _, number in given):
            raise DataError(f"tracks: expected numbers up to {self.largest}, found larger; they are of another dataset")
        self._given = dict(given)
        self._free = {}
        for kind, number in free:
            self._free.setdefault(kind, deque()).append(number)

    def _kind(self, thing: int) -> int:
        return thing if self.by_class else 0


def _table(rows: list[tuple[int, int]]) -> Int64[Tensor, "rows 2"]:
    return torch.tensor(rows, dtype=torch.int64).reshape(-1, 2)
