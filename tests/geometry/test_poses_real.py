"""The poses of real sequences lay the static surroundings of one scan over those of another."""

import os
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from most.datasets.reader import Frame
from most.datasets.semantickitti import SemanticKITTI
from most.geometry.poses import relative, transform

REAL = os.environ.get("MOST_REAL_DATA")
# Rigid things that stand up. Ground is left out: its rings travel with the sensor, and how far apart they lie hides
# how far off a pose is. Leaves are left out because they hardly return the same point twice.
STATIC = ("building", "fence", "trunk", "pole", "traffic-sign")


@pytest.mark.real
@pytest.mark.skipif(not REAL, reason="MOST_REAL_DATA is unset: it names the folder of the unpacked real scans")
@pytest.mark.parametrize(("sequence", "limit"), [("00", 0.06), ("07", 0.04)])
def test_static_points_of_scan_4_fall_onto_scan_9(sequence: str, limit: float) -> None:
    reader = SemanticKITTI(Path(str(REAL)) / "semantickitti")
    static = torch.tensor([reader.taxonomy.class_names.index(name) for name in STATIC])
    source, target = (reader.sweep(Frame(sequence, index)) for index in (4, 9))
    kept = [s.points[torch.isin(reader.taxonomy.to_training(s.labels), static), :3] for s in (source, target)]
    tree, pose = cKDTree(kept[1].numpy()), relative(target.pose, source.pose)

    def distance(sideways: float) -> float:
        moved = transform(pose, kept[0][::4]) + torch.tensor([0.0, sideways, 0.0])
        return float(np.median(tree.query(moved.numpy())[0]))

    assert distance(0.0) <= limit
    assert distance(0.1) > 1.3 * limit  # the measure would notice a pose that is 0.1 m off
