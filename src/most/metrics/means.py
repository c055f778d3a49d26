"""Means and ratios that tell nothing to divide by from 0: they are NaN there."""

import numpy as np
from jaxtyping import Float64
from torch import Tensor


def ratio(part: float, whole: float) -> float:
    """``part / whole``; 0 / 0 is NaN, and anything else by 0 is infinite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.float64(part) / np.float64(whole))


def mean(values: Float64[Tensor, "items"] | Float64[np.ndarray, "items"]) -> float:
    """The mean, NaN of no values."""
    return ratio(float(values.sum()), len(values))
