"""The sparse convolution itself: for each kernel offset gather rows, multiply, add to the output's rows."""

from typing import Any

import torch
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
        return _convolve(features, taps, kernel_map)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        features, taps = ctx.saved_tensors
        gradient = gradient.contiguous()
        by_features = by_taps = None
        if ctx.needs_input_grad[0]:
            by_features = _convolve(gradient, taps.transpose(1, 2), ctx.kernel_map.inverse())
        if ctx.needs_input_grad[1]:
            by_taps = _correlate(features, gradient, taps, ctx.kernel_map)
        return by_features, by_taps, None


def _convolve(features: Tensor, taps: Tensor, kernel_map: KernelMap) -> Tensor:
    if kernel_map.centre is None:
        out = features.new_zeros(len(kernel_map.outputs), taps.shape[2])
    else:
        out = features @ taps[kernel_map.centre]
    pairs = zip(_split(kernel_map.input_rows, kernel_map), _split(kernel_map.output_rows, kernel_map), strict=True)
    for tap, (inputs, outputs) in zip(taps, pairs, strict=True):
        if len(inputs):
            out.index_add_(0, outputs, features.index_select(0, inputs) @ tap)
    return out


def _correlate(features: Tensor, gradient: Tensor, taps: Tensor, kernel_map: KernelMap) -> Tensor:
    """Return the gradient by the taps: for each offset, the inner product of its inputs and its outputs' gradients."""
    out = torch.zeros_like(taps, memory_format=torch.contiguous_format)
    pairs = zip(_split(kernel_map.input_rows, kernel_map), _split(kernel_map.output_rows, kernel_map), strict=True)
    for offset, (inputs, outputs) in enumerate(pairs):
        if offset == kernel_map.centre:
            out[offset] = features.t() @ gradient
        elif len(inputs):
            out[offset] = features.index_select(0, inputs).t() @ gradient.index_select(0, outputs)
    return out


def _split(rows: Tensor, kernel_map: KernelMap) -> tuple[Tensor, ...]:
    return rows.split(kernel_map.counts)
