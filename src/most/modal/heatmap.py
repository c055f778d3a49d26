"""Drawing class-wise heat maps of modal centres (paper, section III; CenterPoint's rule as an option)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from most.errors import ConfigError

KINDS = ("variance", "gaussian_radius")
REACH = 4.0  # standard deviations to which a Gaussian is drawn; beyond, it is below 4e-4


@dataclass
class HeatmapTargets:
    """How the heat maps are drawn.

    ``variance`` (the paper) takes the projected half-extent in cells as the Gaussian's variance, per axis.
    ``gaussian_radius`` is CenterPoint's rule: a round Gaussian as wide as a shift that keeps ``min_overlap``.
    """

    kind: str = "variance"
    min_variance: float = 1.0  # cells squared, kind "variance"
    min_overlap: float = 0.1  # intersection over union, kind "gaussian_radius"
    min_radius: int = 2  # cells, kind "gaussian_radius"
    min_points: int = 1  # instances with fewer points in the current sweep are no targets

    def __post_init__(self) -> None:
        _require(self.kind in KINDS, "kind", f"one of {', '.join(KINDS)}", self.kind)
        _require(self.min_variance > 0, "min_variance", "a value above 0", self.min_variance)
        _require(0 < self.min_overlap < 1, "min_overlap", "a value between 0 and 1", self.min_overlap)
        _require(self.min_radius >= 0, "min_radius", "a value of at least 0", self.min_radius)
        _require(self.min_points >= 1, "min_points", "a value of at least 1", self.min_points)

    def variances(self, half_sizes: Float[Tensor, "instances 2"]) -> Float[Tensor, "instances 2"]:
        """Return the variance along x and y, in cells squared, for projected half-extents in cells."""
        if self.kind == "variance":
            return half_sizes.clamp(min=self.min_variance)
        radius = gaussian_radius(2 * half_sizes, self.min_overlap).floor().clamp(min=self.min_radius)
        return ((2 * radius + 1) / 6).square()[:, None].expand(-1, 2)


def draw_heatmap(
    planes: Int64[Tensor, "peaks"],
    cells: Int64[Tensor, "peaks 2"],
    variances: Float[Tensor, "peaks 2"],
    shape: tuple[int, int, int],
) -> Float[Tensor, "planes x y"]:
    """Return a Gaussian around every peak, exactly 1 at its cell; where Gaussians overlap, the highest.

    ``planes`` and ``cells`` say where the peaks are in a map of ``shape``; ``variances`` are in cells squared.
    """
    reach = (REACH * variances.sqrt()).ceil()
    span = int(reach.max()) if len(reach) else 0
    steps = torch.arange(-span, span + 1, device=cells.device)
    at = cells[:, :, None] + steps  # [peaks, 2, steps]
    inside = (
        (at >= 0) & (at < torch.tensor(shape[1:], device=cells.device)[:, None]) & (steps.abs() <= reach[..., None])
    )
    along = torch.exp(-(steps**2) / (2 * variances[..., None])) * inside
    value = along[:, 0, :, None] * along[:, 1, None, :]  # [peaks, steps, steps]
    at = torch.where(inside, at, 0)
    index = (planes[:, None, None] * shape[1] + at[:, 0, :, None]) * shape[2] + at[:, 1, None, :]
    canvas = variances.new_zeros(shape[0] * shape[1] * shape[2])
    return canvas.scatter_reduce_(0, index.flatten(), value.flatten(), "amax").view(shape)


def gaussian_radius(sizes: Float[Tensor, "boxes 2"], min_overlap: float) -> Float[Tensor, "boxes"]:
    """Return CenterPoint's radius (cells) of boxes of whole ``sizes`` (cells) that shall keep ``min_overlap``.

    It is the least of three roots, and as CenterPoint writes them that is always the third: of a box grown by r
    on every side, w l = min_overlap (w + 2r)(l + 2r), times 4 min_overlap. We keep its numbers, not its detour.
    """
    total, area = sizes.sum(1), sizes.prod(1)
    return (min_overlap**2 * total**2 + 4 * min_overlap * (1 - min_overlap) * area).sqrt() - min_overlap * total


def _require(holds: bool, key: str, expected: str, found: object) -> None:
    if not holds:
        raise ConfigError(f"stage.detection.targets.{key}: expected {expected}, found {found!r}")
