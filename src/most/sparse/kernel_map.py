"""Which row of the input meets which row of the output under which weight of a kernel."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from jaxtyping import Int32
from torch import Tensor

from most.sparse.blocks import Block, blocks_of

if TYPE_CHECKING:
    from most.sparse.sites import Sites


@dataclass
class KernelMap:
    """The pairs of a sparse convolution, grouped by kernel offset in the order of the weights (x slowest, z fastest).

    Rows are counted in the order of the sites' keys. Within one offset they ascend, among the inputs and among the
    outputs: each offset is a partial one-to-one map, and reading it backwards (`inverse`) is as good as forwards.
    """

    inputs: "Sites"
    outputs: "Sites"
    input_rows: Int32[Tensor, "pairs"]
    output_rows: Int32[Tensor, "pairs"]
    counts: list[int]  # pairs of each offset
    centre: int | None  # the offset that maps every row to itself; it has no pairs in the lists

    @cached_property
    def inverse(self) -> "KernelMap":
        """The map of the transposed convolution, from the outputs back to the inputs."""
        back = KernelMap(self.outputs, self.inputs, self.output_rows, self.input_rows, self.counts, self.centre)
        back.__dict__["inverse"] = self
        return back

    @cached_property
    def blocks(self) -> list[Block]:
        """The pairs cut into ranges of output rows, for `sparse_conv` to work through."""
        return blocks_of(self.output_rows, self.counts, len(self.outputs))
