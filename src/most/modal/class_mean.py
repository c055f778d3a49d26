"""Class-wise mean extents in place of those too small to say anything (paper, section IV, "Closing the gap": CWM)."""

from collections.abc import Iterable
from dataclasses import dataclass

import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from most.errors import ConfigError
from most.geometry.poses import yaw
from most.modal.extent import check_floor
from most.modal.instances import Axes, InstanceTable, Shapes

UNKNOWN = [0.0, 0.0, 0.0]  # no instance of the class is large enough to tell


@dataclass
class ClassMean:
    """CWM: shrink-wrapped; along each axis, a half-size of at most ``smallest`` is replaced by its class's mean."""

    smallest: float = 0.06  # m, before a window is scaled
    floor: float = 0.05  # m, where there is no mean

    def __post_init__(self) -> None:
        check_floor(self.floor)
        if not self.smallest >= 0:
            raise ConfigError(f"extent.smallest: expected metres >= 0, found {self.smallest}")

    def build(self, training: Iterable[InstanceTable]) -> "KnownMeans":
        """Take the means over the training split's instances, along the axes of their sensors.

        Half-sizes that would be replaced do not count. The same tables give the same means to the last bit, so a run
        that goes on needs nothing kept of them.
        """
        tables = list(training)
        classes = torch.cat([torch.zeros(0, dtype=torch.int64), *(table.classes for table in tables)])
        sizes = torch.cat([torch.zeros(0, 3, dtype=torch.float64), *map(sensor_half_sizes, tables)])
        named, owners = torch.unique(classes, return_inverse=True)
        counts = sizes > self.smallest
        sums = sizes.new_zeros(len(named), 3).index_add_(0, owners, sizes.where(counts, 0.0))
        numbers = sizes.new_zeros(len(named), 3).index_add_(0, owners, counts.double())
        means = sums / numbers.clamp(min=1)
        return KnownMeans(dict(zip(named.tolist(), means.tolist(), strict=True)), self.smallest, self.floor)


@dataclass
class KnownMeans:
    """The strategy that :class:`ClassMean` becomes."""

    means: dict[int, list[float]]  # half-sizes along the sensor's x, y and z by class, m; 0 for an unknown one
    smallest: float
    floor: float

    def shapes(self, table: InstanceTable, rows: Int64[Tensor, "rows"], axes: Axes) -> Shapes:
        """Return the rows' own outlines, or an ellipsoid of mean half-sizes where these are too small.

        The ellipsoid, and what is too small, follow any turn, flip or scale of the window exactly.
        """
        own = table.outlines.half_sizes(rows, axes.planar, axes.vertical)
        means = own.new_tensor([self.means.get(one, UNKNOWN) for one in table.classes[rows].tolist()]).view(-1, 3)
        means = (means.square() @ axes.linear.square().T).sqrt()
        small = own <= self.smallest * axes.linear.norm(dim=1)
        return Shapes(table.centres[rows], means.where(small & (means > 0), own).clamp(min=self.floor))


def sensor_half_sizes(table: InstanceTable) -> Float64[Tensor, "rows 3"]:
    """Return the half-sizes of all of a table's outlines along the axes of their own sweep's sensor, m."""
    eye = torch.eye(3, dtype=torch.float64)
    frames = [(table.rows(frame), Axes(eye, yaw(pose))) for frame, pose in enumerate(table.poses)]
    sizes = [table.outlines.half_sizes(rows, axes.planar, axes.vertical) for rows, axes in frames]
    return torch.cat([eye[:0], *sizes])
