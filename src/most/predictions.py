"""The prediction of one scan on disk: a label file, the detections beside it, and what an earlier run wrote of it."""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol, runtime_checkable

from jaxtyping import Int64
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.errors import named
from most.inference import Prediction
from most.metrics.assignments import Assignments, assignments_path, read_assignments, write_assignments
from most.structures import Panoptic


@runtime_checkable
class LabelFiles(Protocol):
    """Label files of one kind; a dataset's reader knows its own."""

    taxonomy: Taxonomy

    def read_prediction(self, path: Path) -> Int64[Tensor, "points"]:
        """Read the labels of a scan, as the taxonomy decodes them."""
        ...

    def write_prediction(self, path: Path, labels: Int64[Tensor, "points"]) -> None:
        """Write the labels of a scan, as the taxonomy encodes them."""
        ...


def say_once(
    files: LabelFiles, path: Path, say: Callable[[], Prediction], take_in: Callable[[Prediction], object]
) -> None:
    """Write what is said of a scan, or, where an earlier run did so, take that in: a run goes on as if never stopped.

    The largest number that labels have room for may be several tracks', which labels cannot tell apart: where it
    occurs, the scan is labelled again, and the same is written.
    """
    said = read_prediction(files, path) if path.is_file() else None
    with named(path):
        if said is not None and not bool((said.panoptic.ids == files.taxonomy.label.largest).any()):
            take_in(said)
        else:
            write_prediction(say(), files, path)


def read_prediction(files: LabelFiles, path: Path) -> Prediction:
    """Read back what ``write_prediction`` wrote; DataError where it is not there."""
    labels = files.read_prediction(path)
    found = read_assignments(assignments_path(path), files.taxonomy.num_classes)
    panoptic = Panoptic(files.taxonomy.decode(labels, path), files.taxonomy.instance_of(labels))
    return Prediction(panoptic, found.detections, found.roi, found.assigned)


def write_prediction(prediction: Prediction, files: LabelFiles, path: Path) -> None:
    """Write one scan's detections, then its labels: where labels are, all is."""
    write_assignments(assignments_path(path), Assignments(prediction.detections, prediction.roi, prediction.claimed))
    panoptic = prediction.panoptic
    files.write_prediction(path, files.taxonomy.encode(panoptic.semantics, panoptic.ids))
