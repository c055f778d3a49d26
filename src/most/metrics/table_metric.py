"""Running totals whose states are sparse counts: they grow with the instances seen, never with the points."""

from typing import Any

import numpy as np
import torch
from jaxtyping import Int64
from torch import Tensor
from torchmetrics import Metric

from most.metrics.tables import sum_rows

LOOSE_PARTS = 64  # scans whose rows may wait to be summed up


class TableMetric(Metric):
    """A metric with tables as states, see :mod:`most.metrics.tables`; any process may have none of their rows."""

    full_state_update = False
    higher_is_better = True

    def __init__(self) -> None:
        super().__init__()
        self._widths: dict[str, tuple[int, int]] = {}

    def add_table(self, name: str, keys: int, amounts: int) -> None:
        """Keep a table of so many key columns and amount columns."""
        self._widths[name] = (keys, amounts)
        self.add_state(name, default=[], dist_reduce_fx="cat")

    def add_rows(self, name: str, rows: Int64[np.ndarray, "rows columns"]) -> None:
        """Add counts to a table."""
        if not len(rows):
            return
        parts = getattr(self, name)
        parts.append(torch.from_numpy(rows).to(self.device))
        if len(parts) > LOOSE_PARTS:
            parts[:] = [torch.from_numpy(self._summed(name, parts)).to(self.device)]

    def rows(self, name: str) -> Int64[np.ndarray, "rows columns"]:
        """What a table holds, a row a key, ascending."""
        parts = getattr(self, name)
        return self._summed(name, [parts] if isinstance(parts, Tensor) else parts)  # processes together: a tensor

    def sync(self, *args: Any, **kwargs: Any) -> None:
        """Put the processes' tables together; torchmetrics cannot by itself where one has no rows."""
        for name in self._widths:
            if not len(getattr(self, name)):
                setattr(self, name, [self._empty(name)])
        super().sync(*args, **kwargs)

    def _summed(self, name: str, parts: list[Tensor]) -> Int64[np.ndarray, "rows columns"]:
        return sum_rows(torch.cat([self._empty(name), *parts]).cpu().numpy(), self._widths[name][0])

    def _empty(self, name: str) -> Int64[Tensor, "rows columns"]:
        return torch.zeros(0, sum(self._widths[name]), dtype=torch.int64, device=self.device)
