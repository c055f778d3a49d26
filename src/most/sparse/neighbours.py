"""Look-ups among sorted site keys: which sites are neighbours, and which sites of a coarser grid they fall on.

A key numbers the cells of a grid that has one spare cell at either end of each axis, with z fastest: the key of a
neighbour is the key plus a constant, and stepping over the edge of the grid lands on a cell that is never occupied.
"""

import itertools

import torch
from jaxtyping import Bool, Int64
from torch import Tensor

Shape = tuple[int, int, int]
Pairs = tuple[Int64[Tensor, "_pairs"], Int64[Tensor, "_pairs"]]  # rows of the input, rows of the output; as many each


def keys_of(coordinates: Int64[Tensor, "sites 4"], shape: Shape) -> Int64[Tensor, "sites"]:
    """Number the cells (batch, x, y, z)."""
    batch, x, y, z = coordinates.unbind(1)
    return ((batch * (shape[0] + 2) + x + 1) * (shape[1] + 2) + y + 1) * (shape[2] + 2) + z + 1


def coordinates_of(keys: Int64[Tensor, "sites"], shape: Shape) -> Int64[Tensor, "sites 4"]:
    """Undo `keys_of`."""
    sx, sy, sz = (size + 2 for size in shape)
    return torch.stack([keys // (sx * sy * sz), keys // (sy * sz) % sx - 1, keys // sz % sy - 1, keys % sz - 1], 1)


def column_neighbours(keys: Int64[Tensor, "sites"], shape: Shape, dx: int, dy: int) -> list[Pairs]:
    """Return the pairs of the offsets (dx, dy, -1), (dx, dy, 0) and (dx, dy, 1).

    The three cells lie one after the other in key order, so that one search serves them all: the second is found
    where the first was, or one row on if the first is occupied.
    """
    ended = torch.cat([keys, keys.new_full((1,), torch.iinfo(torch.int64).max)])
    wanted = keys + ((dx * (shape[1] + 2) + dy) * (shape[2] + 2) - 1)
    row = torch.searchsorted(keys, wanted)
    pairs = []
    for _ in range(3):
        hit = ended[row] == wanted
        output_rows = hit.nonzero().squeeze(1)
        pairs.append((row[output_rows], output_rows))
        row, wanted = row + hit, wanted + 1
    return pairs


def coarse_shape(shape: Shape) -> Shape:
    """Halve, rounding up: what stride 2 leaves of a grid, 2-wide without padding or 3-wide with one cell of it."""
    return (-(-shape[0] // 2), -(-shape[1] // 2), -(-shape[2] // 2))


def coarse_pairs(
    coordinates: Int64[Tensor, "sites 4"], shape: Shape, kernel: int
) -> tuple[list[Pairs], Int64[Tensor, "outputs"]]:
    """Return the pairs of each offset of a stride-2 kernel, and the sorted keys of all the cells it reaches."""
    coarse = coarse_shape(shape)
    axes = [_coarse_axis(coordinates[:, axis + 1], coarse[axis], kernel) for axis in range(3)]
    rows, keys = [], []
    for (x, in_x), (y, in_y), (z, in_z) in itertools.product(*axes):
        row = (in_x & in_y & in_z).nonzero().squeeze(1)
        rows.append(row)
        keys.append(keys_of(torch.stack([coordinates[row, 0], x[row], y[row], z[row]], 1), coarse))
    occupied, output_rows = torch.unique(torch.cat(keys), return_inverse=True)
    return list(zip(rows, output_rows.split([len(row) for row in rows]), strict=True)), occupied


def _coarse_axis(
    position: Int64[Tensor, "sites"], size: int, kernel: int
) -> list[tuple[Int64[Tensor, "sites"], Bool[Tensor, "sites"]]]:
    """For each tap of the kernel along one axis: the coarse cell it carries a site to, and whether there is one."""
    taps = []
    for tap in range(kernel):
        doubled = position + (kernel // 3) - tap  # 3-wide is padded by one cell, 2-wide is not
        target = doubled >> 1
        taps.append((target, (doubled & 1 == 0) & (target >= 0) & (target < size)))
    return taps
