"""Hand-made scans, written as stretches of points that share their labels, and random short ones."""

import torch
from hypothesis import strategies as st
from torch import Tensor

Stretch = tuple[int, int, int, int, int]  # points, predicted class, predicted key, true class, true key
Scan = tuple[Tensor, ...]


def scan_of(*stretches: Stretch) -> Scan:
    """Predicted classes and keys, true classes and keys of the points, as metrics take them."""
    return tuple(
        torch.cat([torch.full((stretch[0],), stretch[column]) for stretch in stretches]) for column in (1, 2, 3, 4)
    )


@st.composite
def short_scans(draw: st.DrawFn, num_classes: int = 4, keys: tuple[int, ...] = (0, 1, 2, 3)) -> Scan:
    """A few stretches over few classes and keys, so that collisions, splits and exact halves are common."""
    kind, key = st.integers(0, num_classes - 1), st.sampled_from(keys)
    stretch = st.tuples(st.integers(1, 8), kind, key, kind, key)
    return scan_of(*draw(st.lists(stretch, min_size=1, max_size=8)))


def sequences_of_scans(longest: int = 4) -> st.SearchStrategy[list[tuple[int, Scan]]]:
    """Numbered scans of two sequences, in order."""
    scans = st.lists(short_scans(), max_size=longest)
    return st.tuples(scans, scans).map(lambda pair: [(number, scan) for number in (0, 1) for scan in pair[number]])


def renamed(scan: Scan, pred_names: list[int], truth_names: list[int]) -> Scan:
    """The keys 0, 1, 2, ... by other names."""
    pred_semantics, pred_keys, truth_semantics, truth_keys = scan
    return pred_semantics, torch.tensor(pred_names)[pred_keys], truth_semantics, torch.tensor(truth_names)[truth_keys]
