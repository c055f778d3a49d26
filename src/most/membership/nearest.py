"""The paper's NN-baseline: a point belongs to the nearest centre of its class whose region holds it (Table II)."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from most.membership.evidence import Channels, Evidence
from most.membership.rating import Rating
from most.membership.roi import Pairs


@dataclass
class Nearest(Rating):
    """Membership by distance alone; it has nothing to set and nothing to train."""

    needs = "centres"

    def build(self, channels: Channels) -> "Nearest":
        """It is its own network."""
        return self

    def __call__(self, evidence: Evidence, pairs: Pairs) -> Float[Tensor, "pairs"]:
        """Return the confidence of each pair, in (0.5, 1]: 1 at the centre, less with distance."""
        distance = (evidence.points[pairs.points] - evidence.detections.centres[pairs.detections]).norm(dim=1)
        return 0.5 + 0.5 / (1 + distance)
