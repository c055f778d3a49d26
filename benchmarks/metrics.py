"""Time the metrics beside the official way to compute them, a pass over the points for every class.

    python benchmarks/metrics.py [--scans 1.0] [--points 1.0] [--noise 0.02]

Scans are made up. Both ways take turns of a few scans on one thread, and their figures have to agree. --scans and
--points scale the sizes: 100 scans of 116,000 points for PQ, 200 for LSTQ, 40 of 30,000 for PAT. --noise is the share
of points, strewn over the scan, that are predicted as another segment: smooth predictions are faster still.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from plain_metrics import Labels, PlainLSTQ, PlainPanoptic, PlainTracking

from most.metrics.running import PanopticQuality
from most.metrics.running_tracking import PanopticTracking, SemanticKITTILSTQ

SEQUENCE, TURN = 40, 10  # scans
BEAMS = 64
INSTANCES = 40  # in view, and as wide as 4 to 60 points of a beam


@dataclass
class Dataset:
    """Things come first among the classes."""

    num_classes: int
    num_things: int
    key: Callable[[np.ndarray, np.ndarray], np.ndarray]  # of class and instance id

    @property
    def names(self) -> list[str]:
        """Of all classes, void first."""
        return ["void", *(str(index) for index in range(1, self.num_classes))]

    @property
    def things(self) -> list[int]:
        """The first classes after void."""
        return list(range(1, self.num_things + 1))


SEMANTICKITTI = Dataset(20, 8, lambda classes, ids: (ids << 16) + classes)
SEMANTICKITTI_IDS = Dataset(20, 8, lambda classes, ids: ids)
NUSCENES = Dataset(17, 10, lambda classes, ids: classes * 1000 + ids)


def made_up_scan(number: int, points: int, dataset: Dataset, noise: float) -> Labels:
    """Blocks of stuff and instances before them, which drift from scan to scan; predicted ids change on the way."""
    sequence, time_ = divmod(number, SEQUENCE)
    layout, chance = np.random.default_rng(sequence), np.random.default_rng((1, number))
    columns = -(-points // BEAMS)
    classes = np.repeat(layout.integers(dataset.num_things + 1, dataset.num_classes, (8, 12)), BEAMS // 8, axis=0)
    classes = np.repeat(classes, -(-columns // 12), axis=1)[:, :columns].copy()
    ids, pred_ids = np.zeros_like(classes), np.zeros_like(classes)
    for instance in range(1, INSTANCES + 1):
        row, column = layout.integers(BEAMS - 8), layout.integers(columns) + time_ * layout.integers(-2, 3)
        height, width = layout.integers(3, 9), layout.integers(4, 61)
        place = slice(row, row + height), np.arange(column, column + width) % columns
        classes[place], ids[place] = layout.integers(1, dataset.num_things + 1), instance
        pred_ids[place] = instance + INSTANCES * (time_ // layout.integers(5, 2 * SEQUENCE))
    truth, pred = [classes.ravel()[:points], ids.ravel()[:points]], [classes, np.where(ids > 0, pred_ids, 0)]
    pred = [np.roll(column, 1, axis=1).ravel()[:points] for column in pred]
    strewn = np.flatnonzero(chance.random(points) < noise)
    source = chance.integers(0, points, len(strewn))
    for column in pred:
        column[strewn] = column[source]
    truth[0] = np.where(layout.random(points) < 0.02, 0, truth[0])
    return pred[0], dataset.key(*pred), truth[0], dataset.key(*truth)


def race(name: str, mark: float, metric: Any, plain: Any, scans: int, make: Callable[[int], Labels]) -> None:
    """Feed both all scans, print the ratio of their times, and check that their figures agree."""
    ours = theirs = 0.0
    for first in range(0, scans, TURN):
        turn = [(number // SEQUENCE, make(number)) for number in range(first, min(first + TURN, scans))]
        tensors = [(sequence, *map(torch.from_numpy, labels)) for sequence, labels in turn]
        if isinstance(metric, PanopticQuality):  # it asks for no sequence
            tensors = [columns for _, *columns in tensors]
        ours += seconds(lambda tensors=tensors: [metric.update(*scan) for scan in tensors])
        theirs += seconds(lambda turn=turn: [plain.add(*scan) for scan in turn])
    ours += seconds(metric.compute)
    theirs += seconds(plain.figures)
    figures, expected = metric.compute(), plain.figures()
    for figure, value in expected.items():
        assert abs(figures[figure] - value) < 1e-9, (name, figure, figures[figure], value)
    ratio = theirs / ours
    met = "met" if ratio >= mark else "MISSED"
    shown = ", ".join(f"{figure} {value:.4f}" for figure, value in expected.items())
    print(f"{name:5s} {scans} scans: {ratio:5.1f} times as fast (mark {mark:.0f}: {met}); both say {shown}")


def seconds(task: Callable[[], object]) -> float:
    """Of the processor, so that other programs hardly count."""
    start = time.process_time()
    task()
    return time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", type=float, default=1.0)
    parser.add_argument("--points", type=float, default=1.0)
    parser.add_argument("--noise", type=float, default=0.02)
    arguments = parser.parse_args()
    torch.set_num_threads(1)

    def scans_of(dataset: Dataset, points: int) -> Callable[[int], Labels]:
        return lambda number: made_up_scan(number, round(points * arguments.points), dataset, arguments.noise)

    kitti, nuscenes = SEMANTICKITTI, NUSCENES
    quality = PanopticQuality(kitti.names, kitti.things, min_points=50)
    lstq = SemanticKITTILSTQ(kitti.names, kitti.things, min_points=50)
    tracking = PanopticTracking(nuscenes.names, nuscenes.things, min_points=15)
    counts = [max(1, round(number * arguments.scans)) for number in (100, 200, 40)]
    race("PQ", 8, quality, PlainPanoptic(20, 50), counts[0], scans_of(kitti, 116_000))
    race("LSTQ", 8, lstq, PlainLSTQ(20, 8, 50), counts[1], scans_of(SEMANTICKITTI_IDS, 116_000))
    race("PAT", 5, tracking, PlainTracking(17, 10, 15), counts[2], scans_of(nuscenes, 30_000))


if __name__ == "__main__":
    main()
