"""What simulated scans should have in common with real ones; one function, run on both."""

from collections.abc import Iterable

import numpy as np

SAME = {252: 10, 256: 16, 257: 13, 258: 18, 259: 20, 254: 30, 253: 31, 255: 32}  # moving -> still
THINGS = [10, 11, 13, 15, 16, 18, 20, 30, 31, 32]
RANGES = {10: (8, 12), 20: (16, 24), 40: (32, 48)}  # m, horizontally


def scan_statistics(scans: Iterable[tuple[np.ndarray, np.ndarray]]) -> dict[str, float]:
    """Statistics over (points, labels) of scans; a box is the smallest along the sensor's axes around the points."""
    per_scan, small, contested, cars = [], [], [], []
    for points, labels in scans:
        keys, which, counts, xyz = _things(points[:, :3], labels)
        kinds = np.array([SAME.get(int(key) & 0xFFFF, int(key) & 0xFFFF) for key in keys])
        per_scan.append(len(keys))
        for k in range(len(keys)):
            own = xyz[which == k]
            others = xyz[(which != k) & (kinds[which] == kinds[k])]
            small.append(counts[k] < 50)
            contested.append(bool(((others >= own.min(0)) & (others <= own.max(0))).all(1).any()))
            if kinds[k] == 10:
                cars.append((np.linalg.norm(own.mean(0)[:2]), counts[k]))
    at, count = np.array(cars).T
    seen = {f"points_per_car_at_{r}_m": count[(at >= a) & (at < b)].mean() for r, (a, b) in RANGES.items()}
    shares = {"share_below_50_points": np.mean(small), "share_contested": np.mean(contested)}
    return {"instances_a_scan": float(np.mean(per_scan)), **seen, **shares}


def _things(xyz: np.ndarray, labels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    kinds = np.array([*THINGS, *SAME])
    thing = np.isin(labels & 0xFFFF, kinds) & (labels >> 16 > 0)
    keys, which, counts = np.unique(labels[thing], return_inverse=True, return_counts=True)
    return keys, which, counts, xyz[thing]
