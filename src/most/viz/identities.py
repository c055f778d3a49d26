"""Which colour an instance keeps through a sequence."""

from collections.abc import Mapping

import numpy as np
import torch
from jaxtyping import Int64, UInt8
from matplotlib.colors import to_rgb
from torch import Tensor

from most.viz.palette import UNCLAIMED, identity_colour


class Identities:
    """Numbers the segments of one labelling of a sequence, and so colours them, as they appear.

    Prediction and truth count in different directions (``step``), so that no two of theirs are equal by chance.
    """

    def __init__(self, step: int) -> None:
        self.step = step  # 1 or -1
        self.numbers: dict[int, int] = {}  # by segment, as ``agreement.segments`` names it
        self._taken: set[int] = set()

    def meet(self, segments: Int64[Tensor, "items"], preferred: Mapping[int, int]) -> None:
        """Number the new ones among ``segments``: as ``preferred`` where no other has that number, else the next.

        A prediction prefers the number of the truth that it agrees with when it first appears: an object then has one
        colour in both until its identity is lost, and a switch of identities is a change of colour.
        """
        for segment in torch.unique(segments).tolist():
            if segment == 0 or segment in self.numbers:
                continue
            number = preferred.get(segment, 0)
            if number == 0 or number in self._taken:
                number = self.step * (len(self.numbers) + 1)
            self.numbers[segment] = number
            self._taken.add(number)

    def colours(self, segments: Int64[Tensor, "items"]) -> UInt8[np.ndarray, "items 3"]:
        """RGB of each segment's identity; white for 0, which is no instance."""
        names, places = torch.unique(segments, return_inverse=True)
        chosen = [identity_colour(self.numbers[name]) if name else to_rgb(UNCLAIMED) for name in names.tolist()]
        return np.round(np.array(chosen).reshape(-1, 3)[places.numpy()] * 255).astype(np.uint8)
