"""The sparse convolution itself: gather rows offset by offset, multiply, add up by output row."""

from typing import Any

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor
from torch.autograd.function import once_differentiable

from most.sparse.blocks import Block
from most.sparse.kernel_map import KernelMap


def sparse_conv(
    features: Float[Tensor, "inputs in_channels"],
    weight: Float[Tensor, "out_channels kx ky kz in_channels"],
    kernel_map: KernelMap,
) -> Float[Tensor, "outputs out_channels"]:
    """Convolve features over a kernel map; the weights lie as spconv's do. Under autocast, in autocast's type."""
    device = features.device.type
    if torch.is_autocast_enabled(device) and features.dtype != torch.float64:
        dtype = torch.get_autocast_dtype(device)
        features, weight = features.to(dtype), weight.to(dtype)
    by_offset = weight.flatten(1, 3).permute(1, 2, 0)  # offsets, in, out
    order, rank = kernel_map.inputs.order, kernel_map.outputs.rank
    out: Tensor = _SparseConv.apply(features if order is None else features[order], by_offset, kernel_map)
    return out if rank is None else out[rank]


class _SparseConv(torch.autograd.Function):
    """Saves its inputs only: what it gathers is gathered again in the backward pass, cheaper than keeping it."""

    @staticmethod
    def forward(ctx: Any, features: Tensor, weights: Tensor, kernel_map: KernelMap) -> Tensor:
        ctx.save_for_backward(features, weights)
        ctx.kernel_map = kernel_map
        return _convolve(features, weights, kernel_map)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        features, weights = ctx.saved_tensors
        exact = torch.float32 if weights.dtype in (torch.bfloat16, torch.float16) else weights.dtype
        by_weights = torch.zeros(weights.shape, device=weights.device, dtype=exact)  # a sum over many blocks
        by_features = _convolve(
            gradient.contiguous(), weights.transpose(1, 2), ctx.kernel_map.inverse, correlate=(features, by_weights)
        )
        return by_features, by_weights.to(weights.dtype), None


def _convolve(
    features: Float[Tensor, "inputs in_channels"],
    weights: Float[Tensor, "offsets in_channels out_channels"],
    kernel_map: KernelMap,
    correlate: tuple[Float[Tensor, "outputs out_channels"], Float[Tensor, "offsets out_channels in_channels"]]
    | None = None,
) -> Float[Tensor, "outputs out_channels"]:
    """Convolve block by block: gather and multiply offset by offset, then add up the products of each output row.

    The order of the sum is fixed, whatever the number of threads. In the backward pass the rows that are gathered here
    are the gradients; ``correlate`` holds the features they meet there, and the sum over all pairs of their products,
    which is the gradient by the weights, is added to its second tensor on the way.
    """
    out = features.new_empty(len(kernel_map.outputs), weights.shape[2])
    centre = kernel_map.centre
    for block in kernel_map.blocks:
        products = features.new_empty(len(block.order), weights.shape[2])
        end = 0
        for tap in block.taps:
            begin, end = end, end + len(tap.input_rows)
            gathered = features.index_select(0, tap.input_rows)
            torch.mm(gathered, weights[tap.offset], out=products[begin:end])
            if correlate is not None:
                met = correlate[0].index_select(0, tap.output_rows)
                correlate[1][tap.offset] += met.t() @ gathered
        rows = slice(block.first, block.last)
        if centre is None:
            out[rows] = _sum_by_row(products, block)
        else:
            torch.addmm(_sum_by_row(products, block), features[rows], weights[centre], out=out[rows])
    if centre is not None and correlate is not None:
        correlate[1][centre] += correlate[0].t() @ features
    return out


def _sum_by_row(products: Float[Tensor, "block_pairs channels"], block: Block) -> Float[Tensor, "rows channels"]:
    if len(products) == 0:
        return products.new_zeros(block.last - block.first, products.shape[1])
    return F.embedding_bag(block.order, products, block.starts, mode="sum")
