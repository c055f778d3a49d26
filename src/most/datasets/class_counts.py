"""How many points of each class a split has: what rare classes are weighed by."""

import torch
from jaxtyping import Int64
from torch import Tensor
from tqdm import tqdm

from most.datasets.reader import Reader


def class_counts(reader: Reader, split: str) -> Int64[Tensor, "classes"]:
    """Return the points of each training id, void first, over all labelled sweeps of a split."""
    total = torch.zeros(reader.taxonomy.num_classes, dtype=torch.long)
    for frame in tqdm(reader.frames(split), desc=f"classes of {split}", unit="sweep", leave=False):
        semantics = reader.taxonomy.to_training(reader.labels(frame), frame)
        total += torch.bincount(semantics, minlength=len(total))
    return total
