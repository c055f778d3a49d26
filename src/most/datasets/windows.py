"""A window of sweeps: the current one and those before it, moved into the current sensor frame (paper, section III)."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import torch
from jaxtyping import Float32
from torch import Tensor

from most.datasets.reader import Frame
from most.errors import DataError, check_kept
from most.geometry.poses import relative, transform
from most.structures import OnDevice, Sample, Sweep

OLDEST = 10.0  # s; sweeps before a longer pause say nothing of now, and networks learned from no such ages


@dataclass
class Window(OnDevice):
    """A sweep, and its points with those of the sweeps before it."""

    sweep: Sweep
    points: Float32[Tensor, "points 5"]  # see :func:`gather_window`

    def sample(self) -> Sample:
        """What a network is given of it: no truth."""
        sweep = self.sweep
        return Sample(sweep.sequence, sweep.index, self.points, len(sweep.points), None, None, None)


class SlidingWindow:
    """Makes windows of sweeps as they come; those that no later window reaches are forgotten."""

    def __init__(self, previous: int) -> None:
        """``previous`` counts sweeps before the current one."""
        self.previous = previous
        self._before: deque[Sweep] = deque(maxlen=previous)

    def window(self, sweep: Sweep) -> Window:
        """Return the window of the next sweep, which is not taken in."""
        near = [other for other in self._before if other.index >= sweep.index - self.previous]
        return Window(sweep, gather_window(sweep, near))

    def add(self, sweep: Sweep) -> None:
        """Take in the next sweep."""
        self._before.appendleft(sweep)

    def state(self) -> dict[str, Any]:
        """Return the sweeps that are kept, without labels, the latest first, in plain types and tensors."""
        sweeps = [vars(replace(sweep, labels=None)) for sweep in self._before]
        return {"previous": self.previous, "sweeps": sweeps}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what ``state`` returned; a DataError for what another number of sweeps kept changes nothing."""
        if state["previous"] != self.previous:
            raise DataError(
                f"state: expected one of a model with {self.previous} previous sweeps, found one with "
                f"{state['previous']}; restore it to the model that it came from"
            )
        self._before = deque(map(_kept_sweep, state["sweeps"]), self.previous)


def _kept_sweep(kept: Mapping[str, Any]) -> Sweep:
    """Read a sweep of a state; a DataError where it is none."""
    points, pose = kept["points"], kept["pose"]
    check_kept("points", points, torch.zeros(0, 4), len(points))
    check_kept("pose", pose, torch.eye(4, dtype=torch.float64), 4)
    return Sweep(str(kept["sequence"]), int(kept["index"]), points, pose, float(kept["time"]), None)


def previous_frames(frames: list[Frame], current: Frame, count: int) -> list[Frame]:
    """Of the ``count`` frame numbers before the current one those that exist, latest first; fewer where it starts."""
    before = [frame for frame in frames if current.index - count <= frame.index < current.index]
    return sorted(before, reverse=True)


def gather_window(current: Sweep, previous: list[Sweep]) -> Float32[Tensor, "points 5"]:
    """x, y, z (m, current sensor frame), intensity and time (s, relative, <= 0); the current sweep's points first.

    Previous sweeps that are more than ``OLDEST`` seconds old are left out.
    The current points keep the order of their file, non-finite ones included: each of them needs a label.
    """
    parts = [with_age(current.points, 0.0)]
    for sweep in previous:
        if current.time - sweep.time > OLDEST:
            continue
        moved = transform(relative(current.pose, sweep.pose), sweep.points[:, :3])
        parts.append(with_age(torch.cat([moved, sweep.points[:, 3:]], dim=1), sweep.time - current.time))
    return torch.cat(parts)


def with_age(points: Float32[Tensor, "points 4"], age: float) -> Float32[Tensor, "points 5"]:
    """Add a sweep's time relative to the current one as a column."""
    return torch.cat([points, torch.full((len(points), 1), age)], dim=1)
