"""Short drives held in memory: sweeps whose every number is known, and ladders over them."""

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from most.datasets.reader import Frame
from most.datasets.taxonomy import Taxonomy
from most.datasets.windows import SlidingWindow
from most.geometry.similarity import Similarity
from most.inference import Inference
from most.ladder import Ladder, Look, NoModel
from most.modal.build import LabelRules, build_table
from most.modal.extent import TrackMax
from most.structures import Instances, Sweep
from most.tracking import TrackerSettings
from most.voxels import Grid

KITTI = replace(Taxonomy.load("semantickitti"), min_points=0)
NUSCENES = replace(Taxonomy.load("nuscenes"), min_points=0)
GRID = Grid(voxel_size=[0.5, 0.5, 0.5], lower=[-32.0, -32.0, -2.0], upper=[32.0, 32.0, 2.0])  # BEV cells of 4 m
BOX = torch.tensor([[-1.0, -0.5, -0.5], [1.0, -0.5, 0.5], [-1.0, 0.5, 0.5], [1.0, 0.5, -0.5]])
Objects = Sequence[tuple[int, Sequence[float]]]  # raw label and centre, m


def drive(scans: Sequence[Objects], period: float = 0.1) -> list[Sweep]:
    """Each object is four points about its centre (half-sizes 1, 0.5, 0.5), and so is a piece of stuff."""
    sweeps = []
    for index, objects in enumerate(scans):
        points = torch.cat([BOX + torch.tensor(list(centre)) for _, centre in objects])
        labels = torch.tensor([label for label, _ in objects for _ in BOX])
        points = torch.cat([points, torch.full((len(points), 1), 0.5)], 1)
        sweeps.append(Sweep("08", index, points, torch.eye(4, dtype=torch.float64), period * index, labels))
    return sweeps


def lookup(sweeps: list[Sweep], taxonomy: Taxonomy, frame: Frame, change: Similarity) -> Instances:
    """The instances of a frame."""
    rules = LabelRules(taxonomy.to_training, taxonomy.is_thing, taxonomy.instance_of, max_gap=0.75)
    return build_table(sweeps, rules).instances(frame.index, TrackMax(), change.linear, change.translation)


def no_model(taxonomy: Taxonomy = KITTI) -> NoModel:
    """A look at nothing."""
    return NoModel(GRID, Inference(), taxonomy.num_classes)


def climbed(sweeps: list[Sweep], look: Look, taxonomy: Taxonomy = KITTI) -> dict[str, dict]:
    """Every row's report."""
    ladder = Ladder(taxonomy, lambda *of: lookup(sweeps, taxonomy, *of), look, TrackerSettings())
    windows = SlidingWindow(0)
    for sweep in sweeps:
        ladder.add(windows.window(sweep))
    return ladder.report()


def stuff(label: int, x: float) -> tuple[int, Tensor]:
    """Four points of stuff."""
    return label, torch.tensor([x, 20.0, -1.0])
