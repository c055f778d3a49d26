"""Random predictions and truths of short nuScenes scenes, as labels on disk, with all that may go wrong in them."""

from dataclasses import dataclass

import numpy as np

THINGS = (2, 3, 9, 12, 14, 15, 16, 17, 23)  # categories: two of them are pedestrians, two are buses
STUFF = (24, 26, 28, 30)
VOID = (0, 1005, 20000, 31000)  # truths that count for nothing
COARSE = {2: 7, 3: 7, 9: 1, 12: 8, 14: 2, 15: 3, 16: 3, 17: 4, 23: 10, 24: 11, 26: 13, 28: 15, 30: 16}


@dataclass
class RandomScenes:
    """``pred`` and ``truth`` of all points; the scan of each point, ascending, and the scene of each scan."""

    pred: np.ndarray
    truth: np.ndarray
    scan: np.ndarray
    scene: np.ndarray


def random_scenes(seed: int) -> RandomScenes:
    """One to three scenes of one to six scans; segments have 1 to 14 points."""
    rng = np.random.default_rng(seed)
    parts: list[tuple[np.ndarray, np.ndarray]] = []
    scene: list[int] = []
    for number in range(rng.integers(1, 4)):
        scans = _scene(rng, int(rng.integers(1, 7)))
        parts += scans
        scene += [number] * len(scans)
    scan = np.repeat(np.arange(len(parts)), [len(truth) for _, truth in parts])
    pred, truth = (np.concatenate(columns).astype(np.uint16) for columns in zip(*parts, strict=True))
    return RandomScenes(pred, truth, scan, np.array(scene))


def _scene(rng: np.random.Generator, scans: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Tracks come and go, keep their predicted labels or switch, to new ones or to another's."""
    things = [int(rng.choice(THINGS)) * 1000 + int(rng.integers(0, 4)) for _ in range(rng.integers(0, 7))]
    stuff = [1000 * int(category) for category in rng.choice(STUFF, rng.integers(1, 4), replace=False)]
    tracks = list(dict.fromkeys(things + stuff))
    labels = {track: COARSE[track // 1000] * 1000 + index * (track in things) for index, track in enumerate(tracks, 1)}
    found = []
    for _ in range(scans):
        for track in tracks:
            labels[track] = _next_label(rng, labels, track)
        found.append(_scan(rng, tracks, labels))
    return found


def _next_label(rng: np.random.Generator, labels: dict[int, int], track: int) -> int:
    """Mostly the same; else a new number, another class or stuff, void, or the label of another track."""
    own, number = COARSE[track // 1000] * 1000, int(rng.integers(1, 60))
    others = [own + number, int(rng.integers(1, 17)) * 1000 + number, 0, own, int(rng.choice(list(labels.values())))]
    return int(rng.choice(others)) if rng.random() < 0.3 else labels[track]


def _scan(rng: np.random.Generator, tracks: list[int], labels: dict[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """The tracks that are seen, and void; some points of each have the labels of others."""
    seen = [track for track in tracks if rng.random() < 0.85] + [int(rng.choice(VOID))]
    truth = np.repeat(seen, rng.integers(1, 15, len(seen)))
    pool = [0, *labels.values()]
    pred = np.array([labels.get(int(track), int(rng.choice(pool))) for track in truth])
    wrong = rng.random(len(truth)) < rng.choice([0, 0.1, 0.4])
    pred[wrong] = rng.choice(pool, int(wrong.sum()))
    order = rng.permutation(len(truth))
    return pred[order], truth[order]
