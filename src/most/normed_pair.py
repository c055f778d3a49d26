"""Two normed layers with a wide hidden one between them, which never exists as a whole.

The hidden rows are formed a block at a time, multiplied at once, and formed again in the backward pass: for a window of
eleven sweeps they alone would be a gigabyte, twice more with their gradients; and a block stays in the cache.
"""

from typing import Any

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

from most.norm import normalise
from most.normed_linear import NormedLinear

BLOCK = 8192  # rows


class NormedPair(nn.Module):
    """``narrow(wide(x))`` for rows of points, both :class:`NormedLinear`."""

    def __init__(self, in_channels: int, hidden: int, out_channels: int) -> None:
        super().__init__()
        self.wide = NormedLinear(in_channels, hidden)
        self.narrow = NormedLinear(hidden, out_channels)

    def forward(self, x: Float[Tensor, "rows in_channels"]) -> Float[Tensor, "rows out_channels"]:
        """Normalise by the batch's statistics in training (of two rows or more), by the running ones else."""
        weight, bias = self.wide.folded(x)
        product = relu_product(x, weight, bias, self.narrow.linear.weight)
        return F.relu_(normalise(product, self.narrow.norm))


def relu_product(
    x: Float[Tensor, "rows in_channels"],
    weight: Float[Tensor, "hidden in_channels"],
    bias: Float[Tensor, "hidden"],
    out_weight: Float[Tensor, "out_channels hidden"],
) -> Float[Tensor, "rows out_channels"]:
    """Return ``relu(x @ weight.T + bias) @ out_weight.T``. Under autocast, in autocast's type."""
    device = x.device.type
    if torch.is_autocast_enabled(device) and x.dtype != torch.float64:
        dtype = torch.get_autocast_dtype(device)
        x, weight, bias, out_weight = x.to(dtype), weight.to(dtype), bias.to(dtype), out_weight.to(dtype)
    out: Tensor = _ReluProduct.apply(x, weight, bias, out_weight)
    return out


class _ReluProduct(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, bias: Tensor, out_weight: Tensor) -> Tensor:
        ctx.save_for_backward(x, weight, bias, out_weight)
        out = x.new_empty(len(x), len(out_weight))
        for rows in _blocks(len(x)):
            torch.mm(_hidden(x[rows], weight, bias), out_weight.t(), out=out[rows])
        return out

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        x, weight, bias, out_weight = ctx.saved_tensors
        by_x = torch.empty_like(x)
        exact = torch.float32 if x.dtype in (torch.bfloat16, torch.float16) else x.dtype
        by_weight, by_bias, by_out_weight = (torch.zeros_like(t, dtype=exact) for t in (weight, bias, out_weight))
        for rows in _blocks(len(x)):
            hidden = _hidden(x[rows], weight, bias)
            by_out_weight += gradient[rows].t() @ hidden
            by_hidden = (gradient[rows] @ out_weight).mul_(hidden > 0)
            by_weight += by_hidden.t() @ x[rows]
            by_bias += by_hidden.sum(0)
            torch.mm(by_hidden, weight, out=by_x[rows])
        return by_x, by_weight.to(x.dtype), by_bias.to(x.dtype), by_out_weight.to(x.dtype)


def _blocks(rows: int) -> list[slice]:
    return [slice(first, first + BLOCK) for first in range(0, rows, BLOCK)]


def _hidden(x: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    return torch.addmm(bias, x, weight.t()).relu_()
