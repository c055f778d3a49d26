"""Sums of intersections over union that are the same in any order, and so however scans are shared by processes.

The sum of float64 numbers depends on its order by rounding. A float64 of at least one half is a whole number of
2**-53; split at 2**-26, its coarse parts add up exactly to 2**27, and its fine parts over 2**26 terms.
"""

import torch
from jaxtyping import Float64
from torch import Tensor

COARSE = 2.0**-26


def exact_parts(amounts: Float64[Tensor, "*shape"]) -> Float64[Tensor, "2 *shape"]:
    """Split amounts, each 0 or at least one half, into parts that add up without rounding."""
    coarse = torch.floor(amounts / COARSE) * COARSE
    return torch.stack([coarse, amounts - coarse])


def joined(parts: Float64[Tensor, "2 *shape"]) -> Float64[Tensor, "*shape"]:
    """The amount that (sums of) parts stand for, rounded once."""
    return parts[0] + parts[1]
