"""Which row of the input meets which row of the output under which weight of a kernel."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import torch
from jaxtyping import Int32
from torch import Tensor

if TYPE_CHECKING:
    from most.sparse.sites import Sites


@dataclass
class KernelMap:
    """The pairs of a sparse convolution, grouped by kernel offset in the order of the weights (x slowest, z fastest).

    Within one offset no row occurs twice, neither among the inputs nor among the outputs: each offset is a partial
    one-to-one map, so that reading it backwards (`inverse`) is as good as reading it forwards.
    """

    inputs: "Sites"
    outputs: "Sites"
    input_rows: Int32[Tensor, "pairs"]
    output_rows: Int32[Tensor, "pairs"]
    counts: list[int]  # pairs of each offset
    centre: int | None  # the offset that maps every row to itself; it has no pairs in the lists

    @cached_property
    def bags(self) -> tuple[Int32[Tensor, "pairs"], Int32[Tensor, "outputs"]]:
        """The pairs in the order of their output rows, and where those of each output row begin."""
        rows, order = self.output_rows.sort(stable=True)
        every = torch.arange(len(self.outputs), dtype=torch.int32, device=rows.device)
        return order.int(), torch.searchsorted(rows, every, out_int32=True)

    @cached_property
    def inverse(self) -> "KernelMap":
        """The map of the transposed convolution, from the outputs back to the inputs."""
        back = KernelMap(self.outputs, self.inputs, self.output_rows, self.input_rows, self.counts, self.centre)
        back.__dict__["inverse"] = self
        return back
