"""Which row of the input meets which row of the output under which weight of a kernel."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from jaxtyping import Int64
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
    input_rows: Int64[Tensor, "pairs"]
    output_rows: Int64[Tensor, "pairs"]
    counts: list[int]  # pairs of each offset
    centre: int | None  # the offset that maps every row to itself; it has no pairs in the lists

    def inverse(self) -> "KernelMap":
        """Return the map of the transposed convolution, from the outputs back to the inputs."""
        return KernelMap(self.outputs, self.inputs, self.output_rows, self.input_rows, self.counts, self.centre)
