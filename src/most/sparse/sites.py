"""The occupied cells of a batch of grids, and the kernel maps from them."""

import itertools

import torch
from jaxtyping import Int64
from torch import Tensor

from most.sparse.kernel_map import KernelMap
from most.sparse.neighbours import (
    Pairs,
    Shape,
    coarse_pairs,
    coarse_shape,
    column_neighbours,
    coordinates_of,
    keys_of,
    lower_neighbours,
)


class Sites:
    """Occupied cells of a batch of grids; row ``i`` of a feature tensor belongs to site ``i``.

    Kernel maps are built once and kept: every layer that convolves over the same sites shares them, and an inverse
    convolution reads the map of the strided one backwards. Sites in the order of (batch, x, y, z) are fastest, but
    any order is right.
    """

    def __init__(self, coordinates: Int64[Tensor, "sites 4"], shape: Shape, batch_size: int) -> None:
        self.coordinates = coordinates  # batch, x, y, z
        self.shape = shape
        self.batch_size = batch_size
        self._keys = keys_of(coordinates, shape)
        self.order: Tensor | None = None  # rows in the order of the keys; None where they are in it already
        self.rank: Tensor | None = None  # the place of each row in that order
        if not bool((self._keys[1:] > self._keys[:-1]).all()):
            self._keys, self.order = self._keys.sort()
            self.rank = self.order.argsort()
            if bool((self._keys[1:] == self._keys[:-1]).any()):
                raise ValueError("Sites: expected each site once, found some twice")
        self._columns: dict[tuple[int, int], list[Pairs]] = {}
        self._submanifold: dict[tuple[int, int, int], KernelMap] = {}
        self._strided: dict[int, KernelMap] = {}

    def __len__(self) -> int:
        return len(self.coordinates)

    def rows(self, coordinates: Int64[Tensor, "cells 4"]) -> Int64[Tensor, "cells"]:
        """Return the row of each of these cells (batch, x, y, z), all of which are occupied."""
        place = torch.searchsorted(self._keys, keys_of(coordinates, self.shape))
        return place if self.order is None else self.order[place]

    def submanifold(self, kernel: tuple[int, int, int]) -> KernelMap:
        """Return the map of a convolution whose outputs are these sites themselves; each width is 1 or 3."""
        if kernel not in self._submanifold:
            if not set(kernel) <= {1, 3}:
                raise ValueError(f"submanifold kernel: expected widths of 1 or 3, found {kernel}")
            self._submanifold[kernel] = self._build_submanifold(kernel)
        return self._submanifold[kernel]

    def strided(self, kernel: int) -> KernelMap:
        """Return the map of a stride-2 convolution, whose outputs are all the cells that any input reaches.

        2-wide kernels tile the grid; 3-wide ones overlap (one cell of padding), so that the occupied part grows.
        """
        if kernel not in self._strided:
            if kernel not in (2, 3):
                raise ValueError(f"strided kernel: expected a width of 2 or 3, found {kernel}")
            pairs, keys = coarse_pairs(coordinates_of(self._keys, self.shape), self.shape, kernel)
            shape = coarse_shape(self.shape)
            coarse = Sites(coordinates_of(keys, shape), shape, self.batch_size)
            self._strided[kernel] = _joined(self, coarse, pairs, None)
        return self._strided[kernel]

    def _build_submanifold(self, kernel: tuple[int, int, int]) -> KernelMap:
        """Look up one half of the offsets: the other half is the same pairs the other way round."""
        offsets = list(itertools.product(*(range(-(width // 2), width // 2 + 1) for width in kernel)))
        centre = len(offsets) // 2
        half = [self._pairs(*offset) for offset in offsets[:centre]]
        nothing = self.coordinates.new_empty(0, dtype=torch.int32)
        return _joined(self, self, [*half, (nothing, nothing), *((o, i) for i, o in reversed(half))], centre)

    def _pairs(self, dx: int, dy: int, dz: int) -> Pairs:
        """Return the pairs of one offset; those of a whole column are looked up together."""
        if (dx, dy) not in self._columns:
            beside = (dx, dy) != (0, 0)
            found = column_neighbours(self._keys, self.shape, dx, dy) if beside else [lower_neighbours(self._keys)]
            self._columns[dx, dy] = [(inputs.int(), outputs.int()) for inputs, outputs in found]
        return self._columns[dx, dy][dz + 1]


def _joined(inputs: Sites, outputs: Sites, pairs: list[Pairs], centre: int | None) -> KernelMap:
    return KernelMap(inputs, outputs, [i.int() for i, _ in pairs], [o.int() for _, o in pairs], centre)
