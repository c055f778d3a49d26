"""The outline of an instance: as much of its shape as any turned, flipped or scaled extent needs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64, Int64
from scipy.spatial import ConvexHull, QhullError
from torch import Tensor


@dataclass
class Outlines:
    """Convex outlines in the horizontal plane, each about its own modal centre, and their heights; stored end to end.

    The half-extent of a shape along a unit direction u is its support max |(p - c) . u|, and only the vertices of the
    convex hull of the p - c can attain it. Keeping these few vertices instead of the support in some sampled directions
    makes the half-sizes exact under every linear map of the plane, and costs about as much.
    """

    vertices: Float32[Tensor, "vertices 2"]  # p - c turned to world heading, m
    starts: Int64[Tensor, "outlines_and_one"]  # outline i owns vertices starts[i]:starts[i + 1], at least one
    heights: Float32[Tensor, "outlines"]  # max |z - c_z|, m

    def __len__(self) -> int:
        return len(self.heights)

    def half_sizes(
        self, rows: Int64[Tensor, "rows"], planar: Float64[Tensor, "2 2"], vertical: float
    ) -> Float64[Tensor, "rows 3"]:
        """Return max |A v| along x, y and z, with ``planar`` and ``vertical`` the parts of the linear map A."""
        sizes = self.starts[rows + 1] - self.starts[rows]
        owners = torch.repeat_interleave(torch.arange(len(rows)), sizes)
        first = torch.cumsum(sizes, 0) - sizes
        vertices = self.vertices[torch.arange(len(owners)) - first[owners] + self.starts[rows][owners]]
        reach = (vertices.double() @ planar.T).abs()
        flat = reach.new_zeros(len(rows), 2).scatter_reduce_(0, owners[:, None].expand(-1, 2), reach, "amax")
        return torch.cat([flat, self.heights[rows, None].double() * abs(vertical)], 1)


def join(hulls: Sequence[np.ndarray], heights: Sequence[float]) -> Outlines:
    """Store hulls [vertices, 2] and their heights end to end."""
    starts = np.cumsum([0, *(len(hull) for hull in hulls)])
    vertices = np.concatenate([np.zeros((0, 2)), *hulls])
    return Outlines(
        vertices=torch.from_numpy(vertices.astype(np.float32)),
        starts=torch.from_numpy(starts.astype(np.int64)),
        heights=torch.from_numpy(np.asarray(heights, np.float32)),
    )


def merge(outlines: Outlines, owners: Int64[np.ndarray, "outlines"], num_owners: int) -> Outlines:
    """Return for each owner the outline about all of its outlines, laid over one another at their centres."""
    order = np.argsort(owners, kind="stable")
    groups = np.split(order, np.searchsorted(owners[order], np.arange(1, num_owners)))[: num_owners or None]
    vertices, starts, heights = (part.numpy() for part in (outlines.vertices, outlines.starts, outlines.heights))
    if num_owners == 0:
        return join([], [])
    hulls = [hull(np.concatenate([vertices[starts[i] : starts[i + 1]] for i in group])) for group in groups]
    return join(hulls, [float(heights[group].max()) for group in groups])


def hull(points: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "vertices 2"]:
    """Return the points that are vertices of the convex hull; a point or a line gives its ends."""
    if len(points) > 3:
        try:
            return points[ConvexHull(points).vertices]
        except QhullError:  # the points lie on one line or in one place
            return points[_ends(points)]
    return points


def _ends(points: Float[np.ndarray, "points 2"]) -> Int64[np.ndarray, "ends"]:
    """Return the points extreme along the axes and the diagonals: among them the ends of any line."""
    reach = points @ np.array([[1, 0, 1, 1], [0, 1, 1, -1]], points.dtype)
    return np.unique(np.concatenate([reach.argmin(0), reach.argmax(0)]))
