"""Making a sequence's instance table from its labelled sweeps."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float64, Int64
from torch import Tensor

from most.geometry.means import group_means
from most.geometry.poses import yaw
from most.modal.instances import InstanceTable, turn
from most.modal.outline import hull, join, merge
from most.structures import Sweep


@dataclass(frozen=True)
class LabelRules:
    """What the raw labels of a dataset say; a table needs no more of it."""

    to_training: Callable[[Tensor], Tensor]  # raw label -> training id
    is_thing: Callable[[Tensor], Tensor]  # training id -> bool
    instance_of: Callable[[Tensor], Tensor]  # raw label -> instance id; 0 is no instance (``raw >> 16`` in KITTI)
    max_gap: float = 0.35  # s; a velocity needs the track's next or previous frame within this time


@dataclass
class _Frame:
    """The rows of one frame."""

    index: int
    time: float
    pose: Float64[Tensor, "4 4"]
    keys: Int64[Tensor, "rows"]
    counts: Int64[Tensor, "rows"]
    centres: Float64[Tensor, "rows 3"]
    hulls: list[np.ndarray]
    heights: list[float]


def build_table(sweeps: Iterable[Sweep], rules: LabelRules) -> InstanceTable:
    """Return the instances of the labelled ones among ``sweeps``, which follow one another in one sequence.

    Points of things with instance id 0 belong to no instance and are left out.
    """
    frames = [_measure(sweep, sweep.labels, rules) for sweep in sweeps if sweep.labels is not None]
    keys = _cat([frame.keys for frame in frames])
    names, tracks = torch.unique(keys, return_inverse=True)
    sizes = torch.tensor([0, *(len(frame.keys) for frame in frames)])
    owners = torch.repeat_interleave(torch.arange(len(frames)), sizes[1:])
    poses = torch.stack([frame.pose for frame in frames]) if frames else torch.zeros(0, 4, 4, dtype=torch.float64)
    centres = torch.cat([torch.zeros(0, 3, dtype=torch.float64), *(frame.centres for frame in frames)])
    world = torch.einsum("rij,rj->ri", poses[owners, :3, :3], centres) + poses[owners, :3, 3]
    times = torch.tensor([frame.time for frame in frames], dtype=torch.float64)[owners]
    velocities, known = centred_differences(tracks, times, world, rules.max_gap)
    outlines = join([h for frame in frames for h in frame.hulls], [z for frame in frames for z in frame.heights])
    return InstanceTable(
        frames=torch.tensor([frame.index for frame in frames], dtype=torch.int64),
        poses=poses,
        starts=torch.cumsum(sizes, 0),
        keys=keys,
        classes=rules.to_training(keys),
        counts=_cat([frame.counts for frame in frames]),
        tracks=tracks,
        centres=centres,
        world_centres=world,
        world_velocities=velocities,
        velocity_known=known,
        outlines=outlines,
        track_outlines=merge(outlines, tracks.numpy(), len(names)),
    )


def centred_differences(
    tracks: Int64[Tensor, "rows"], times: Float64[Tensor, "rows"], centres: Float64[Tensor, "rows 3"], max_gap: float
) -> tuple[Float64[Tensor, "rows 3"], Bool[Tensor, "rows"]]:
    """Return (mu[next] - mu[previous]) / (t[next] - t[previous]) of every track (paper, "Modal panoptic tracking").

    Rows are ordered by time. At a track's ends and beside gaps longer than ``max_gap`` seconds the row itself stands in
    for the missing neighbour; where both are missing the velocity is unknown: the second result says where it is known.
    """
    order = torch.argsort(tracks, stable=True)
    track, time = tracks[order], times[order]
    here = torch.arange(len(order))
    linked = (track[1:] == track[:-1]) & (time[1:] - time[:-1] <= max_gap)
    before, after = here.clone(), here.clone()
    before[1:] -= linked.long()
    after[:-1] += linked.long()
    span = time[after] - time[before]
    known = span > 0
    step = centres[order][after] - centres[order][before]
    back = torch.argsort(order)
    return (step / torch.where(known, span, torch.inf)[:, None])[back], known[back]


def _measure(sweep: Sweep, labels: Int64[Tensor, "points"], rules: LabelRules) -> _Frame:
    """Return the rows of one sweep: keys ascending, centres the mean of their points, outlines in world heading."""
    is_instance = rules.is_thing(rules.to_training(labels)) & (rules.instance_of(labels) != 0)
    is_instance &= sweep.points[:, :3].isfinite().all(1)
    points = sweep.points[is_instance, :3].double()
    keys, owners, counts = torch.unique(labels[is_instance], return_inverse=True, return_counts=True)
    centres, _ = group_means(points, owners, len(keys))
    pose = sweep.pose.double()
    about = points - centres[owners]
    flat = (about[:, :2] @ turn(yaw(pose)).T).numpy()
    groups = np.split(np.argsort(owners.numpy(), kind="stable"), torch.cumsum(counts, 0)[:-1].numpy())[: len(keys)]
    return _Frame(
        index=sweep.index,
        time=sweep.time,
        pose=pose,
        keys=keys,
        counts=counts,
        centres=centres,
        hulls=[hull(flat[group]) for group in groups],
        heights=[float(about[group, 2].abs().max()) for group in groups],
    )


def _cat(parts: list[Tensor]) -> Int64[Tensor, "rows"]:
    return torch.cat([torch.zeros(0, dtype=torch.int64), *parts])
