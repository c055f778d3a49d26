"""Linear layer, batch normalisation and ReLU in one pass over the rows.

The mean and variance of ``x @ W.T`` follow from those of ``x``: with mean m and covariance S of the rows, output j has
mean ``W_j m`` and variance ``W_j S W_j``. So the normalisation folds into the weights before the product is formed, and
neither the product nor its normalised copy has to be kept for the backward pass: a quarter of the memory and, on a CPU
that is short of bandwidth, less time.
"""

from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.autograd.function import once_differentiable
from torch.nn import functional as F

from most.processes import count, summed

MOMENTUM = 0.1  # of the running statistics


class NormedLinear(nn.Module):
    """``relu(batch_norm(x @ weight.T))`` for rows of points."""

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.linear = nn.Linear(in_channels, out_channels, bias=False)
        self.norm = nn.BatchNorm1d(out_channels, momentum=MOMENTUM)

    def forward(self, x: Float[Tensor, "rows in_channels"]) -> Float[Tensor, "rows out_channels"]:
        """Normalise by the batch's statistics in training (of two rows or more), by the running ones else."""
        return F.linear(x, *self.folded(x)).relu_()

    def folded(
        self, x: Float[Tensor, "rows in_channels"]
    ) -> tuple[Float[Tensor, "out_channels in_channels"], Float[Tensor, "out_channels"]]:
        """Return the weight and bias that make product and normalisation of these rows one."""
        rows = count(len(x), x.device) if self.training else 0
        mean, variance = self._statistics(x, rows) if rows > 1 else self._running()
        scale = self.norm.weight * torch.rsqrt(variance + self.norm.eps)
        return self.linear.weight * scale[:, None], self.norm.bias - scale * mean

    def _statistics(
        self, x: Float[Tensor, "rows in_channels"], rows: int
    ) -> tuple[Float[Tensor, "out_channels"], Float[Tensor, "out_channels"]]:
        """Return mean and variance of the product over the ``rows`` of all processes; note them in the running ones."""
        weight = self.linear.weight
        with torch.autocast(x.device.type, enabled=False):  # squares need the full precision
            moments: Tensor = _Moments.apply(x.to(weight.dtype), rows)
            mean, second = summed(moments).split([1, x.shape[1]])
            covariance = second - mean.T * mean
            mean, variance = (weight @ mean.T).squeeze(1), ((weight @ covariance) * weight).sum(1).clamp(min=0)
        with torch.no_grad():
            running_mean, running_variance = self._running()
            running_mean.lerp_(mean, MOMENTUM)
            running_variance.lerp_(variance * rows / (rows - 1), MOMENTUM)
        return mean, variance

    def _running(self) -> tuple[Float[Tensor, "out_channels"], Float[Tensor, "out_channels"]]:
        mean, variance = self.norm.running_mean, self.norm.running_var
        assert mean is not None  # the norm was made to keep both
        assert variance is not None
        return mean, variance


class _Moments(torch.autograd.Function):
    """Sums of the rows (first) and of their outer products (below), over ``rows``; one product on the way back."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, rows: int) -> Tensor:
        ctx.save_for_backward(x)
        ctx.rows = rows
        return torch.cat([x.sum(0, keepdim=True), x.T @ x]) / rows

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        (x,) = ctx.saved_tensors
        by_sum, by_second = (gradient / ctx.rows).split([1, x.shape[1]])
        return torch.addmm(by_sum, x, by_second + by_second.T), None
