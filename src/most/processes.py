"""Sums over the processes of a distributed run. With one process they are the values themselves.

Every process calls the same sums in the same order, whatever its own batch holds.
"""

from typing import Any

import torch
from torch import Tensor, distributed
from torch.autograd.function import once_differentiable


def processes() -> int:
    """How many processes train together."""
    return distributed.get_world_size() if distributed.is_available() and distributed.is_initialized() else 1


def total(values: Tensor) -> Tensor:
    """Sum over all processes, without a gradient."""
    if processes() == 1:
        return values.detach()
    everyones = values.detach().clone()
    distributed.all_reduce(everyones)
    return everyones


def count(items: int, device: torch.device) -> int:
    """Sum a number of items over all processes."""
    return items if processes() == 1 else int(total(torch.tensor(items, device=device)))


def rank() -> int:
    """Which of the processes this is."""
    return distributed.get_rank() if processes() > 1 else 0


def everyones(items: list[Any]) -> list[Any]:
    """Join what each process has, in the order of the processes; tensors are expected on the CPU."""
    if processes() == 1:
        return items
    shares: list[list[Any]] = [[] for _ in range(processes())]
    distributed.all_gather_object(shares, items)
    return [item for share in shares for item in share]


def summed(values: Tensor) -> Tensor:
    """Sum over all processes; its gradient is the sum of theirs."""
    if processes() == 1:
        return values
    out: Tensor = _Sum.apply(values)
    return out


def mean_over_all(part: Tensor, items: Tensor, smallest: float = 1.0) -> Tensor:
    """A loss summed over this process' items, divided by the mean number of ``items`` a process has.

    Averaged over processes, as DDP averages gradients, it is the sum over all items divided by their number.
    """
    return part * processes() / total(items.to(part.dtype)).clamp(min=smallest)


class _Sum(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor) -> Tensor:
        return total(values)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> Tensor:
        return total(gradient)
