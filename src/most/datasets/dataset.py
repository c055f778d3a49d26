"""Samples by index: reads a window of sweeps, augments it, and adds the truth of the current sweep."""

import math
from collections.abc import Callable

import numpy as np
import torch
from torch.utils.data import Dataset

from most.datasets.augment import Augment
from most.datasets.half_swap import swap_half
from most.datasets.reader import Frame, Reader
from most.datasets.windows import gather_window, previous_frames
from most.geometry.similarity import Similarity
from most.structures import Instances, Sample, Sweep

InstanceLookup = Callable[[Frame, Similarity], Instances]  # the instances of a frame, as the transform leaves them


class WindowDataset(Dataset[Sample]):
    """One :class:`Sample` a frame; what augmentation draws depends on (seed, epoch, index) alone.

    ``set_epoch`` reaches worker processes too, running ones included: the epoch lies in shared memory.
    """

    def __init__(
        self,
        reader: Reader,
        frames: list[Frame],
        previous: int,
        augment: Augment | None = None,
        instances: InstanceLookup | None = None,
        seed: int = 0,
        cache: bool = False,
    ) -> None:
        """``previous`` counts sweeps before the current one; ``cache`` keeps sweeps in memory once they are read."""
        self.reader = reader
        self.frames = frames
        self.previous = previous
        self.augment = augment or Augment()
        self.instances = instances
        self.seed = seed
        self.cached: dict[Frame, Sweep] | None = {} if cache else None
        self.neighbours = {name: reader.frames_of(name) for name in {frame.sequence for frame in frames}}
        for name in self.neighbours:
            reader.poses(
                name
            )  # the reader keeps them: read here once, they are not read again by every loading process
        self.epoch = torch.zeros((), dtype=torch.int64).share_memory_()

    def __len__(self) -> int:
        return len(self.frames)

    def set_epoch(self, epoch: int) -> None:
        """Choose what augmentation draws next."""
        self.epoch.fill_(epoch)

    def __getitem__(self, index: int) -> Sample:
        rng = np.random.default_rng([self.seed, int(self.epoch), index])
        sample = self._window(self.frames[index], rng)
        if self.augment.swaps(rng):
            other = self._window(self.frames[rng.integers(len(self))], rng)
            sample = swap_half(sample, other, rng.uniform(-math.pi, math.pi))
        return sample

    def _window(self, frame: Frame, rng: np.random.Generator) -> Sample:
        current = self.sweep(frame)
        before = previous_frames(self.neighbours[frame.sequence], frame, self.previous)
        points = gather_window(current, [self.sweep(other) for other in before])
        change = self.augment.transform(rng)
        points[:, :3] = change.apply(points[:, :3])
        points[:, 3] *= self.augment.brightness(rng)
        labels = current.labels
        return Sample(
            sequence=frame.sequence,
            index=frame.index,
            points=points,
            num_current=len(current.points),
            labels=labels,
            semantics=None if labels is None else self.reader.taxonomy.to_training(labels, frame),
            instances=None if labels is None or self.instances is None else self.instances(frame, change),
        )

    def sweep(self, frame: Frame) -> Sweep:
        """Read a sweep, from memory where it is kept there."""
        if self.cached is None:
            return self.reader.sweep(frame)
        if frame not in self.cached:
            self.cached[frame] = self.reader.sweep(frame)
        return self.cached[frame]
