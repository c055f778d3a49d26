"""What scoring asks of a dataset: its labels, what they mean, and, for memberships, its scans and instances."""

from pathlib import Path
from typing import Protocol, TypeVar, runtime_checkable

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from most.structures import Instances, Sweep


@runtime_checkable
class SweepName(Protocol):
    """Whatever names a sweep to its reader."""

    @property
    def sequence(self) -> str:
        """The sequence it belongs to."""
        ...


Frame = TypeVar("Frame", bound=SweepName, contravariant=True)


@runtime_checkable
class Taxonomy(Protocol):
    """What the labels of the dataset mean; classes are training ids, 0 is void."""

    @property
    def name(self) -> str:
        """Of the dataset."""
        ...

    @property
    def class_names(self) -> list[str]:
        """Indexed by class."""
        ...

    @property
    def things(self) -> list[int]:
        """The classes that are things."""
        ...

    @property
    def min_points(self) -> int:
        """Of an unmatched segment that counts."""
        ...

    def to_training(self, raw: Int64[Tensor, "points"], source: object) -> Int64[Tensor, "points"]:
        """Classes of raw labels; raises DataError, naming ``source``, for labels that the dataset cannot have."""
        ...

    def decode(self, labels: Int64[Tensor, "points"], source: object) -> Int64[Tensor, "points"]:
        """Classes of a submission's labels; raises DataError, naming ``source``, for labels no submission can have."""
        ...

    def is_thing(self, semantics: Int64[Tensor, "points"]) -> Bool[Tensor, "points"]:
        """Whether each class is a thing."""
        ...

    def instance_of(self, raw: Int64[Tensor, "points"]) -> Int64[Tensor, "points"]:
        """The instance's number in a raw label, 0 for no instance."""
        ...


@runtime_checkable
class TruthReader(Protocol[Frame]):
    """Reads the truth; the scans themselves are only needed for the membership accuracy."""

    @property
    def taxonomy(self) -> Taxonomy:
        """Of the dataset."""
        ...

    def labels(self, frame: Frame) -> Int64[Tensor, "points"]:
        """Raw labels; raises DataError where there are none."""
        ...

    def sweep(self, frame: Frame) -> Sweep:
        """The scan itself."""
        ...

    def read_prediction(self, path: Path) -> Int64[Tensor, "points"]:
        """A submission's labels of a frame; raises DataError where there are none."""
        ...

    def prediction_path(self, folder: Path, frame: Frame) -> Path:
        """Where a submission keeps its labels of a frame."""
        ...


def find_instances(
    points: Float[Tensor, "points 3"],
    labels: Int64[Tensor, "points"],
    semantics: Int64[Tensor, "points"],
    taxonomy: Taxonomy,
) -> Instances:
    """The instances of one scan with their modal centres, which is all that matching takes: no extents, no motion."""
    own = taxonomy.is_thing(semantics) & (taxonomy.instance_of(labels) != 0) & points.isfinite().all(1)
    keys, owner, counts = torch.unique(labels[own], return_inverse=True, return_counts=True)
    sums = torch.zeros(len(keys), 3, dtype=torch.float64).index_add_(0, owner, points[own].double())
    return Instances(
        keys=keys,
        classes=torch.zeros_like(keys).index_copy_(0, owner, semantics[own]),
        counts=counts,
        centres=(sums / counts[:, None]).float(),
        extents=torch.zeros(len(keys), 3),
        velocities=torch.zeros(len(keys), 2),
        velocity_known=torch.zeros(len(keys), dtype=torch.bool),
    )
