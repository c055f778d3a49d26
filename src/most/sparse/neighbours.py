"""Look-ups among sorted site keys: which sites are neighbours, and which sites of a coarser grid they fall on.

A key numbers the cells of a grid that has one spare cell at either end of each axis, with z fastest: the key of a
neighbour is the key plus a constant, and stepping over the edge of the grid lands on a cell that is never occupied.
"""

import itertools

import torch
from jaxtyping import Bool, Int, Int64
from torch import Tensor

Shape = tuple[int, int, int]
Pairs = tuple[Int[Tensor, "_pairs"], Int[Tensor, "_pairs"]]  # rows of the input, rows of the output; as many each


def keys_of(coordinates: Int64[Tensor, "sites 4"], shape: Shape) -> Int64[Tensor, "sites"]:
    """Number the cells (batch, x, y, z)."""
    batch, x, y, z = coordinates.unbind(1)
    return ((batch * (shape[0] + 2) + x + 1) * (shape[1] + 2) + y + 1) * (shape[2] + 2) + z + 1


def coordinates_of(keys: Int64[Tensor, "sites"], shape: Shape) -> Int64[Tensor, "sites 4"]:
    """Undo `keys_of`."""
    sx, sy, sz = (size + 2 for size in shape)
    return torch.stack([keys // (sx * sy * sz), keys // (sy * sz) % sx - 1, keys // sz % sy - 1, keys % sz - 1], 1)


def lower_neighbours(keys: Int64[Tensor, "sites"]) -> Pairs:
    """Return the pairs of the offset (0, 0, -1): a cell just below is the row before."""
    output_rows = (keys[1:] == keys[:-1] + 1).nonzero().squeeze(1) + 1
    return output_rows - 1, output_rows


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
    halved = torch.cat([coordinates[:, :1], coordinates[:, 1:] >> 1], 1)
    here = keys_of(halved, coarse)
    strides = ((coarse[1] + 2) * (coarse[2] + 2), coarse[2] + 2, 1)
    axes = [
        _coarse_axis(coordinates[:, axis + 1], halved[:, axis + 1], coarse[axis], kernel, strides[axis])
        for axis in range(3)
    ]
    rows, keys = [], []
    for (in_x, step_x), (in_y, step_y), (in_z, step_z) in itertools.product(*axes):
        row = (in_x & in_y & in_z).nonzero().squeeze(1)
        rows.append(row)
        keys.append(here[row] + (step_x + step_y + step_z))
    occupied, output_rows = _ranked(torch.cat(keys))
    return list(zip(rows, output_rows.split([len(row) for row in rows]), strict=True)), occupied


def _coarse_axis(
    position: Int64[Tensor, "sites"], halved: Int64[Tensor, "sites"], size: int, kernel: int, stride: int
) -> list[tuple[Bool[Tensor, "sites"], int]]:
    """For each tap of the kernel along one axis: which sites it takes, and how far from half their place, in keys.

    2-wide: tap 0 takes even places, tap 1 odd ones. 3-wide, padded by one cell: an even place is in the middle of one
    window; an odd one is the last of the window it is in and the first of the next, where there is a next.
    """
    odd = position & 1 == 1
    if kernel == 2:
        return [(~odd, 0), (odd, 0)]
    return [(odd & (halved + 1 < size), stride), (~odd, 0), (odd, 0)]


def _ranked(keys: Int64[Tensor, "pairs"]) -> tuple[Int64[Tensor, "outputs"], Int64[Tensor, "pairs"]]:
    """Return the keys that occur, ascending, and the place of each key among them."""
    small = len(keys) == 0 or int(keys.max()) < torch.iinfo(torch.int32).max
    ascending, order = (keys.int() if small else keys).sort()  # half as wide is twice as fast
    first = torch.ones_like(ascending, dtype=torch.bool)
    torch.ne(ascending[1:], ascending[:-1], out=first[1:])
    place = torch.empty_like(keys)
    place[order] = first.cumsum(0) - 1
    return ascending[first].long(), place
