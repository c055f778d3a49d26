"""Two processes that see half of the scans each give exactly the figures of one that sees all."""

from pathlib import Path

import torch
from torch import distributed, multiprocessing

from golden_cases import FOLDER, GoldenScan, read_golden
from most.metrics.running import PanopticQuality
from most.metrics.running_tracking import NuScenesLSTQ, PanopticTracking, SemanticKITTILSTQ

WORLD = 2
NAMES, THINGS = ["void", *(str(index) for index in range(1, 17))], range(1, 11)
KITTI_NAMES, KITTI_THINGS = ["void", *(str(index) for index in range(1, 20))], range(1, 9)


def figures(nuscenes: list[GoldenScan], kitti: list[GoldenScan], sequences: set[int]) -> str:
    """All figures to the last bit; PAT sees the nuScenes scans of some sequences, the others the scans given."""
    quality = PanopticQuality(NAMES, list(THINGS), min_points=15)
    metrics = [
        NuScenesLSTQ(NAMES, THINGS),
        SemanticKITTILSTQ(KITTI_NAMES, KITTI_THINGS),
        PanopticTracking(NAMES, THINGS),
    ]
    for scan in nuscenes:
        quality.update(*scan.labels)
        metrics[0].update(scan.sequence, *scan.ids)
    for scan in kitti:
        metrics[1].update(scan.sequence, *scan.ids)
    for scan in golden_scans("nuscenes_pat_lstq"):
        if scan.sequence in sequences:
            metrics[2].update(scan.sequence, *scan.labels)
    return repr([(metric.compute(), metric.per_class()) for metric in (quality, *metrics)])


def golden_scans(part: str) -> list[GoldenScan]:
    return read_golden(FOLDER / part / "main.json").scans


def share(rank: int, folder: Path) -> None:
    """One of the processes: every other scan, PAT two of three whole sequences or the third; no scan of SemanticKITTI.

    All of those go to process 0, so that the other one has empty tables.
    """
    torch.set_num_threads(1)
    distributed.init_process_group("gloo", f"file://{folder / 'meeting'}", rank=rank, world_size=WORLD)
    kitti = golden_scans("semantickitti_lstq") if rank == 0 else []
    found = figures(golden_scans("nuscenes_pat_lstq")[rank::WORLD], kitti, [{0, 2}, {1}][rank])
    (folder / f"{rank}.txt").write_text(found)
    distributed.destroy_process_group()


def test_two_processes_with_half_of_the_scans_are_one_with_all(tmp_path: Path) -> None:
    """Tracks have to stay whole, so a process takes all scans of a sequence; LSTQ and PQ take scans in any order."""
    multiprocessing.spawn(share, (tmp_path,), WORLD)
    expected = figures(golden_scans("nuscenes_pat_lstq"), golden_scans("semantickitti_lstq"), {0, 1, 2})
    assert "nan" not in expected.lower().replace("'tq': nan", "")
    for rank in range(WORLD):
        assert (tmp_path / f"{rank}.txt").read_text() == expected
