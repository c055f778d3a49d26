"""The order of samples: shuffled by (seed, epoch), so that a resumed run goes on exactly as it would have."""

from collections.abc import Iterator

import numpy as np
from torch.utils.data import Sampler

from most.datasets.dataset import WindowDataset
from most.processes import processes, rank


class OrderedSampler(Sampler[int]):
    """A dataset in order, shared out among the processes of a distributed run: none twice, so shares may be uneven."""

    def __init__(self, dataset: WindowDataset) -> None:
        self.indices = range(len(dataset))[rank() :: processes()]

    def __len__(self) -> int:
        return len(self.indices)

    def __iter__(self) -> Iterator[int]:
        return iter(self.indices)


class EpochSampler(Sampler[int]):
    """A shuffled epoch of a dataset, shared out evenly among the processes of a distributed run.

    ``set_epoch``, which Lightning calls, reaches the dataset's augmentation as well. Where processes do not divide the
    samples evenly, a few are seen twice: all processes must take the same number of steps.
    """

    def __init__(self, dataset: WindowDataset, seed: int, epoch: int = 0, done: int = 0) -> None:
        """Begin at ``epoch``, the first ``done`` samples of which (of this process) were seen before."""
        self.dataset = dataset
        self.seed = seed
        self.done = done
        self.rank, self.processes = rank(), processes()
        self.set_epoch(epoch)

    def set_epoch(self, epoch: int) -> None:
        """Choose the order, and what augmentation draws."""
        self.epoch = epoch
        self.dataset.set_epoch(epoch)

    def __len__(self) -> int:
        return -(-len(self.dataset) // self.processes)

    def __iter__(self) -> Iterator[int]:
        order = np.random.default_rng([self.seed, self.epoch]).permutation(len(self.dataset))
        share = np.arange(self.rank, len(self) * self.processes, self.processes) % len(self.dataset)
        done, self.done = self.done, 0
        return iter(order[share][done:].tolist())
