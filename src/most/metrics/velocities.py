"""How far the velocities of detections are from those of the objects that they stand for."""

from dataclasses import dataclass

from jaxtyping import Bool, Float, Int64
from torch import Tensor

from most.membership.matching import match_detections
from most.structures import Detections, Instances, Rows

MOVING = 1.0  # m/s, and faster


@dataclass
class VelocityErrors(Rows):
    """The detected moving objects of any number of scans."""

    classes: Int64[Tensor, "objects"]
    errors: Float[Tensor, "objects"]  # length of the difference between predicted and true velocity, m/s
    speeds: Float[Tensor, "objects"]  # true ones, m/s: the error of predicting zero

    def summary(self) -> dict[str, float]:
        """``objects``, and the mean errors ``predicted`` and of ``zero``, m/s; NaN where there is none."""
        means = {"predicted": float(self.errors.double().mean()), "zero": float(self.speeds.double().mean())}
        return {"objects": len(self)} | means


def is_moving(truth: Instances) -> Bool[Tensor, "instances"]:
    """Whether each instance is known to be at least as fast as ``MOVING``."""
    return truth.velocity_known & (truth.velocities.norm(dim=1) >= MOVING)


def velocity_errors(detections: Detections, roi: Float[Tensor, "detections 3"], truth: Instances) -> VelocityErrors:
    """Compare the velocities of one scan's detections with those of moving objects; others do not count,
    nor do detections without one.

    ``roi`` are half-sizes (m) as in :func:`most.membership.matching.match_detections`, which says who stands for whom.
    """
    matches = match_detections(detections, roi, truth)
    stands = matches >= 0
    found, objects = detections.select(stands), truth.select(matches[stands])
    errors = (found.velocities - objects.velocities).norm(dim=1)
    counted = is_moving(objects) & errors.isfinite()
    return VelocityErrors(objects.classes, errors, objects.velocities.norm(dim=1)).select(counted)
