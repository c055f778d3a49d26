"""The windows of sequences in the order of time, each sweep read from disk once."""

from bisect import bisect_left
from collections.abc import Iterator
from itertools import groupby

from torch.utils.data import DataLoader, IterableDataset

from most.datasets.loaders import start_method
from most.datasets.reader import Frame, Reader
from most.datasets.windows import SlidingWindow, Window


class WindowStream(IterableDataset[Window]):
    """The windows of some frames: those of a sequence follow each other, by number."""

    def __init__(self, reader: Reader, frames: list[Frame], previous: int) -> None:
        """``previous`` counts sweeps before the current one."""
        self.reader, self.frames, self.previous = reader, frames, previous

    def __iter__(self) -> Iterator[Window]:
        for name, frames in groupby(self.frames, key=lambda frame: frame.sequence):
            yield from self._sequence(name, [frame.index for frame in frames])

    def _sequence(self, name: str, wanted: list[int]) -> Iterator[Window]:
        windows = SlidingWindow(self.previous)
        for frame in self.reader.frames_of(name):
            following = bisect_left(wanted, frame.index)
            if following == len(wanted) or wanted[following] > frame.index + self.previous:
                continue  # in no window
            sweep = self.reader.sweep(frame)
            if wanted[following] == frame.index:
                yield windows.window(sweep)
            windows.add(sweep)

    def load(self, ahead: bool) -> DataLoader[Window]:
        """Iterate over it, in a process of its own where that is to read ``ahead``."""
        workers = int(ahead)
        context = start_method(workers)
        return DataLoader(self, batch_size=None, num_workers=workers, multiprocessing_context=context)
