"""Ranges of output rows, small enough that all that is gathered and multiplied for one of them stays in the cache.

That also bounds what a convolution needs beside its inputs and outputs, however many sweeps are in the window, and
keeps the allocator from going to the system for every large array, which costs more than the arithmetic does.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Int32
from torch import Tensor

PAIRS_PER_BLOCK = 32768  # 8 MB at 64 channels
PAIRS_PER_BLOCK_GPU = 1 << 24  # few kernels, each of them large


@dataclass
class Block:
    """A range of output rows and the pairs that end there.

    Their products lie in a buffer, offset after offset; ``order`` puts them in the order of the output rows.
    """

    first: int
    last: int  # one past the end
    slices: list[tuple[int, int, int]]  # offset, and the range of its pairs; only offsets that have any
    order: Int32[Tensor, "block_pairs"]
    starts: Int32[Tensor, "rows"]  # where the products of each row begin in ``order``


def blocks_of(output_rows: Int32[Tensor, "pairs"], counts: list[int], outputs: int) -> list[Block]:
    """Cut a kernel map's pairs, grouped by offset and ascending in each, into blocks of as many rows each."""
    device = output_rows.device
    most = PAIRS_PER_BLOCK if device.type == "cpu" else PAIRS_PER_BLOCK_GPU
    parts = max(1, -(-len(output_rows) // most))
    bounds = [outputs * part // parts for part in range(parts + 1)]
    cuts = _cuts(output_rows, counts, bounds, outputs)  # offsets, bounds
    place = _places(cuts, len(output_rows))
    order, starts = _by_row(output_rows, counts, outputs, place)
    edges = starts[torch.tensor(bounds, device=device)].tolist()
    limits = cuts.tolist()
    return [
        Block(
            first=bounds[part],
            last=bounds[part + 1],
            slices=[
                (k, limit[part], limit[part + 1]) for k, limit in enumerate(limits) if limit[part] < limit[part + 1]
            ],
            order=order[edges[part] : edges[part + 1]],
            starts=starts[bounds[part] : bounds[part + 1]] - edges[part],
        )
        for part in range(parts)
    ]


def _cuts(output_rows: Tensor, counts: list[int], bounds: list[int], outputs: int) -> Tensor:
    """Return where, in the list of all pairs, each block begins within each offset: [offsets, bounds]."""
    device = output_rows.device
    offset = torch.arange(len(counts), device=device) * (outputs + 1)
    ascending = output_rows + offset.repeat_interleave(torch.tensor(counts, device=device))
    return torch.searchsorted(ascending, offset[:, None] + torch.tensor(bounds, device=device))


def _places(cuts: Tensor, pairs: int) -> Int32[Tensor, "pairs"]:
    """Return the place of each pair's product in the buffer of its block."""
    sizes = cuts.diff(dim=1)  # offsets, blocks
    shift = sizes.cumsum(0) - sizes - cuts[:, :-1]
    place = torch.arange(pairs, device=cuts.device) + shift.flatten().repeat_interleave(sizes.flatten())
    return place.int()


def _by_row(output_rows: Tensor, counts: list[int], outputs: int, place: Tensor) -> tuple[Tensor, Tensor]:
    """Return the places in the order of the output rows, and where each row begins (one more than there are rows).

    Counting beats sorting: each offset fills the next free slot of each of its rows.
    """
    starts = output_rows.new_zeros(outputs + 1)
    starts[1:] = torch.bincount(output_rows, minlength=outputs).cumsum(0)
    free = starts.clone()
    order = torch.empty_like(place)
    for rows, places in zip(output_rows.split(counts), place.split(counts), strict=True):
        slot = free.index_select(0, rows)
        order[slot] = places
        free[rows] = slot + 1
    return order, starts
