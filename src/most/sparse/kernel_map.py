"""Which row of the input meets which row of the output under which weight of a kernel."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from torch import Tensor

from most.sparse.blocks import Block, blocks_of, mirrored

if TYPE_CHECKING:
    from most.sparse.sites import Sites


@dataclass
class KernelMap:
    """The pairs of a sparse convolution: for each weight of the kernel (x slowest, z fastest) the rows it joins.

    Rows are int32 and counted in the order of the sites' keys. Within one offset they ascend, among the inputs and
    among the outputs: each offset is a partial one-to-one map, and reading it backwards (`inverse`) is as good as
    reading it forwards.
    """

    inputs: "Sites"
    outputs: "Sites"
    input_rows: list[Tensor]
    output_rows: list[Tensor]
    centre: int | None  # the offset that maps every row to itself; its lists are empty

    @property
    def counts(self) -> list[int]:
        """Pairs of each offset."""
        return [len(rows) for rows in self.input_rows]

    @cached_property
    def inverse(self) -> "KernelMap":
        """The map of the transposed convolution, from the outputs back to the inputs."""
        back = KernelMap(self.outputs, self.inputs, self.output_rows, self.input_rows, self.centre)
        back.__dict__["inverse"] = self
        if self.centre is not None:
            back.__dict__["blocks"] = mirrored(self.blocks, len(self.input_rows))
        return back

    @cached_property
    def blocks(self) -> list[Block]:
        """The pairs cut into ranges of output rows, for `sparse_conv` to work through."""
        return blocks_of(self.input_rows, self.output_rows, len(self.outputs))
