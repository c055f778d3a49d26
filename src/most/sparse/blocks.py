"""Ranges of output rows, small enough that all that is gathered and multiplied for one of them stays in the cache.

That also bounds what a convolution needs beside its inputs and outputs, however many sweeps are in the window, and
keeps the allocator from going to the system for every large array, which costs more than the arithmetic does.
"""

import itertools
from dataclasses import dataclass, replace

import torch
from jaxtyping import Int32
from torch import Tensor

PAIRS_PER_BLOCK = 32768  # 8 MB at 64 channels
PAIRS_PER_BLOCK_GPU = 1 << 24  # few kernels, each of them large


@dataclass
class Tap:
    """The pairs of one kernel offset in one block."""

    offset: int
    input_rows: Int32[Tensor, "tap_pairs"]
    output_rows: Int32[Tensor, "tap_pairs"]


@dataclass
class Block:
    """A range of output rows and the pairs that end there.

    The pairs' products lie in a buffer, tap after tap; ``order`` puts them in the order of the output rows.
    """

    first: int
    last: int  # one past the end
    taps: list[Tap]  # only those that have any pairs
    order: Int32[Tensor, "block_pairs"]
    starts: Int32[Tensor, "rows"]  # where the products of each row begin in ``order``


def blocks_of(input_rows: list[Tensor], output_rows: list[Tensor], outputs: int) -> list[Block]:
    """Cut the pairs, listed by offset and ascending in each list, into blocks of as many output rows each."""
    device = output_rows[0].device
    pairs = sum(len(rows) for rows in output_rows)
    parts = max(1, -(-pairs // (PAIRS_PER_BLOCK if device.type == "cpu" else PAIRS_PER_BLOCK_GPU)))
    bounds = [outputs * part // parts for part in range(parts + 1)]
    limits = torch.tensor(bounds, dtype=torch.int32, device=device)
    cuts = torch.stack([torch.searchsorted(rows, limits) for rows in output_rows]).tolist()
    order, starts = _by_row(output_rows, outputs, cuts)
    edges = starts[limits].tolist()
    return [
        Block(
            first=bounds[part],
            last=bounds[part + 1],
            taps=[
                Tap(offset, input_rows[offset][cut[part] : cut[part + 1]], rows[cut[part] : cut[part + 1]])
                for offset, (rows, cut) in enumerate(zip(output_rows, cuts, strict=True))
                if cut[part] < cut[part + 1]
            ],
            order=order[edges[part] : edges[part + 1]],
            starts=starts[bounds[part] : bounds[part + 1]] - edges[part],
        )
        for part in range(parts)
    ]


def mirrored(blocks: list[Block], offsets: int) -> list[Block]:
    """Return the blocks of the opposite map of a submanifold one: the pairs of each offset are its opposite's."""
    return [
        replace(block, taps=[replace(tap, offset=offsets - 1 - tap.offset) for tap in block.taps]) for block in blocks
    ]


def _by_row(
    output_rows: list[Tensor], outputs: int, cuts: list[list[int]]
) -> tuple[Int32[Tensor, "pairs"], Int32[Tensor, "bounds"]]:
    """Return the places of all products in their block's buffer, by output row, and where each row begins.

    Counting beats sorting: each offset fills the next free slot of each of its rows.
    """
    every = torch.cat(output_rows)
    starts = torch.zeros(outputs + 1, dtype=torch.int64, device=every.device)
    starts[1:] = torch.bincount(every, minlength=outputs).cumsum(0)
    free = starts.clone()
    order = torch.empty_like(every)
    filled = [0] * (len(cuts[0]) - 1)  # of each block's buffer
    for rows, cut in zip(output_rows, cuts, strict=True):
        place = torch.empty_like(rows)
        for part, (start, stop) in enumerate(itertools.pairwise(cut)):
            torch.arange(filled[part], filled[part] + stop - start, out=place[start:stop])
            filled[part] += stop - start
        row = rows.long()
        slot = free[row]
        order[slot] = place
        free[row] = slot + 1
    return order, starts.int()
