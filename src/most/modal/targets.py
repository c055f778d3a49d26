"""What the detection heads shall say: class-wise heat maps of modal centres, and regressions at the centres' cells."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from most.geometry.boxes import bounds
from most.modal.heatmap import HeatmapTargets, draw_heatmap
from most.structures import Instances, OnDevice


@dataclass
class BevTargets(OnDevice):
    """Targets of the detection heads: the heat map is dense, the regressions are listed per centre cell.

    No two centres share a cell: the heads regress one centre a cell, and that is of the instance with the most points.
    """

    heatmap: Float[Tensor, "batch things x y"]  # in [0, 1], exactly 1 at the centres' cells
    cells: Int64[Tensor, "centres 3"]  # batch, x, y
    offset: Float[Tensor, "centres 2"]  # of the centre from its cell's middle, cells, in [-0.5, 0.5]
    height: Float[Tensor, "centres 1"]  # z of the modal centre, m
    extent: Float[Tensor, "centres 3"]  # log of the half-sizes in m
    velocity: Float[Tensor, "centres 2"]  # m/s, where known
    velocity_known: Bool[Tensor, "centres"]
    yaw: Float[Tensor, "centres 2"] | None = None  # sine and cosine of twice the yaw; None where boxes have none


def bev_targets(
    instances: list[Instances],
    lower: tuple[float, float],
    cell: tuple[float, float],
    shape: tuple[int, int],
    thing_ids: list[int],
    settings: HeatmapTargets,
) -> BevTargets:
    """Return the targets of a batch for a BEV grid with its lower corner at ``lower`` (m), cells of ``cell`` (m).

    Channel k of the heat map is the class ``thing_ids[k]``. Instances whose centre lies outside the grid are left out.
    """
    batch = torch.cat([torch.full_like(each.keys, i) for i, each in enumerate(instances)])
    merged = Instances.cat(instances)
    device = merged.centres.device
    size, sides = torch.tensor(cell, device=device), torch.tensor(shape, device=device)
    position = (merged.centres[:, :2] - torch.tensor(lower, device=device)) / size
    middle = position.floor()
    hits = merged.classes[:, None] == torch.tensor(thing_ids, device=device)
    keep = ((middle >= 0) & (middle < sides)).all(1) & hits.any(1) & (merged.counts >= settings.min_points)

    merged, batch, position, middle = merged.select(keep), batch[keep], position[keep], middle[keep]
    cells = torch.cat([batch[:, None], middle.long()], 1)
    planes = batch * len(thing_ids) + hits[keep].long().argmax(1)
    variances = settings.variances(bounds(merged.extents, merged.yaws)[:, :2] / size)
    heatmap = draw_heatmap(planes, cells[:, 1:], variances, (len(instances) * len(thing_ids), *shape))
    chosen = _largest_per_cell((cells[:, 0] * shape[0] + cells[:, 1]) * shape[1] + cells[:, 2], merged.counts)
    heatmap, offset = heatmap.view(len(instances), len(thing_ids), *shape), position - middle - 0.5
    return _regressed_at(heatmap, cells[chosen], offset[chosen], merged.select(chosen))


def _regressed_at(
    heatmap: Float[Tensor, "batch things x y"],
    cells: Int64[Tensor, "centres 3"],
    offset: Float[Tensor, "centres 2"],
    instances: Instances,
) -> BevTargets:
    """Join a heat map with what is regressed at the cells of these instances' centres."""
    yaws = instances.yaws
    return BevTargets(
        heatmap,
        cells,
        offset,
        height=instances.centres[:, 2:],
        extent=instances.extents.log(),
        velocity=instances.velocities,
        velocity_known=instances.velocity_known,
        yaw=None if yaws is None else torch.stack([(2 * yaws).sin(), (2 * yaws).cos()], 1),
    )


def _largest_per_cell(cells: Int64[Tensor, "centres"], counts: Int64[Tensor, "centres"]) -> Int64[Tensor, "chosen"]:
    """Return which centre of each cell has the most points; the first where they are equal."""
    by_count = torch.argsort(counts, descending=True, stable=True)
    order = by_count[torch.argsort(cells[by_count], stable=True)]
    first = torch.ones_like(order, dtype=torch.bool)
    first[1:] = cells[order][1:] != cells[order][:-1]
    return order[first]
