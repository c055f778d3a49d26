"""The sparse convolution itself: for each kernel offset gather rows, multiply, add to the output's rows."""

from typing import Any

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor
from torch.autograd.function import once_differentiable

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
    taps = weight.flatten(1, 3).permute(1, 2, 0)  # offsets, in, out
    out: Tensor = _SparseConv.apply(features, taps, kernel_map)
    return out


class _SparseConv(torch.autograd.Function):
    """Saves its inputs only: what it gathers is gathered again in the backward pass, cheaper than keeping it."""

    @staticmethod
    def forward(ctx: Any, features: Tensor, taps: Tensor, kernel_map: KernelMap) -> Tensor:
        ctx.save_for_backward(features, taps)
        ctx.kernel_map = kernel_map
        products = features.new_empty(len(kernel_map.input_rows), taps.shape[2])
        inputs = kernel_map.input_rows.split(kernel_map.counts)
        for tap, rows, product in zip(taps, inputs, products.split(kernel_map.counts), strict=True):
            torch.mm(features.index_select(0, rows), tap, out=product)
        out = _sum_by_output(products, kernel_map)
        return out if kernel_map.centre is None else out.addmm_(features, taps[kernel_map.centre])

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        features, taps = ctx.saved_tensors
        kernel_map: KernelMap = ctx.kernel_map
        gradient = gradient.contiguous()
        products = features.new_empty(len(kernel_map.input_rows), taps.shape[1])
        by_taps = torch.empty_like(taps, memory_format=torch.contiguous_format)
        for tap, by_tap, input_rows, output_rows, product in zip(
            taps,
            by_taps,
            kernel_map.input_rows.split(kernel_map.counts),
            kernel_map.output_rows.split(kernel_map.counts),
            products.split(kernel_map.counts),
            strict=True,
        ):
            gathered = gradient.index_select(0, output_rows)
            torch.mm(gathered, tap.t(), out=product)
            torch.mm(features.index_select(0, input_rows).t(), gathered, out=by_tap)
        by_features = _sum_by_output(products, kernel_map.inverse)
        if kernel_map.centre is not None:
            by_features.addmm_(gradient, taps[kernel_map.centre].t())
            torch.mm(features.t(), gradient, out=by_taps[kernel_map.centre])
        return by_features, by_taps, None


def _sum_by_output(
    products: Float[Tensor, "pairs channels"], kernel_map: KernelMap
) -> Float[Tensor, "outputs channels"]:
    """Add up what the pairs bring to each output row, always in the same order, whatever the number of threads."""
    order, starts = kernel_map.bags
    if len(order) == 0:
        return products.new_zeros(len(kernel_map.outputs), products.shape[1])
    return F.embedding_bag(order, products, starts, mode="sum")
