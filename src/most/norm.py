"""Batch normalisation, with the statistics of the whole batch however many processes share it.

torch's SyncBatchNorm refuses tensors on a CPU and rows of uneven number; this serves both devices.
"""

from typing import Any

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

from most.processes import processes, total


class NormReLU(nn.BatchNorm1d):
    """Batch normalisation over all dimensions but the second, then ReLU (unless ``relu=False``).

    Where fewer than two rows make a variance meaningless (an empty crop, a lone voxel), training falls back on the
    running statistics and leaves them as they are.
    """

    def __init__(self, channels: int, relu: bool = True) -> None:
        super().__init__(channels)
        self.relu = relu

    def forward(self, x: Float[Tensor, "rows channels ..."]) -> Float[Tensor, "rows channels ..."]:
        """Normalise; the input is not needed after this."""
        out = normalise(x, self)
        return F.relu_(out) if self.relu else out


def normalise(x: Float[Tensor, "rows channels ..."], norm: nn.BatchNorm1d) -> Float[Tensor, "rows channels ..."]:
    """Apply a norm's weights with the batch's statistics while it trains, else with its running ones."""
    if norm.training and processes() > 1:
        out: Tensor = _SharedNorm.apply(x, norm.weight, norm.bias, norm)
        return out
    measure = norm.training and x.numel() // x.shape[1] > 1
    return F.batch_norm(
        x, norm.running_mean, norm.running_var, norm.weight, norm.bias, measure, norm.momentum or 0.0, norm.eps
    )


class _SharedNorm(torch.autograd.Function):
    """Two small sums over the processes: counts and moments on the way there, gradients on the way back."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, bias: Tensor, norm: nn.BatchNorm1d) -> Tensor:
        assert norm.running_mean is not None  # the norm was made to keep both
        assert norm.running_var is not None
        dims, count = _all_but_channels(x), x.numel() // x.shape[1]
        here = x.double() if x.dtype == torch.float64 else x.float()
        sums = torch.cat([here.sum(dims), here.square().sum(dims), here.new_tensor([count])])
        channels = len(weight)
        by_value, by_square, number = total(sums.double()).split([channels, channels, 1])
        measured = number > 1
        mean, square = by_value / number.clamp(min=1), by_square / number.clamp(min=1)
        variance = (square - mean * mean).clamp(min=0)
        mean = torch.where(measured, mean, norm.running_mean).to(here.dtype)
        variance = torch.where(measured, variance, norm.running_var).to(here.dtype)
        pace = torch.where(measured, norm.momentum or 0.0, 0.0).to(here.dtype)
        norm.running_mean.lerp_(mean, pace)
        norm.running_var.lerp_(variance * (number / (number - 1).clamp(min=1)).to(here.dtype), pace)
        ctx.save_for_backward(x, weight, mean, torch.rsqrt(variance + norm.eps))
        ctx.number = torch.where(measured, number, torch.inf)  # running statistics have no gradient
        return F.batch_norm(x, mean, variance, weight, bias, False, 0.0, norm.eps)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor, Tensor, None]:
        x, weight, mean, scale = ctx.saved_tensors
        dims, form = _all_but_channels(x), (1, -1, *[1] * (x.dim() - 2))
        normed = (x - mean.view(form)) * scale.view(form)
        by_weight, by_bias = (gradient * normed).sum(dims), gradient.sum(dims)
        channels = len(weight)
        all_weight, all_bias = (total(torch.cat([by_weight, by_bias]).double()) / ctx.number).split(channels)
        centred = gradient - all_bias.to(x.dtype).view(form) - normed * all_weight.to(x.dtype).view(form)
        return (weight * scale).view(form).to(x.dtype) * centred, by_weight, by_bias, None


def _all_but_channels(x: Tensor) -> list[int]:
    return [0, *range(2, x.dim())]
