"""What a dataset's reader offers. Adding a dataset is one reader, one taxonomy and one YAML file.

``tests/datasets/test_reader_contract.py`` runs over all readers and says in code what is promised here.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from jaxtyping import Float64, Int64
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.modal.boxes import SequenceBoxes
from most.structures import Sweep

SPLITS = ("train", "val", "test")


@dataclass(frozen=True, order=True)
class Frame:
    """Names one sweep: its sequence, and its number there, which is also its row among the sequence's poses."""

    sequence: str
    index: int


@runtime_checkable
class Reader(Protocol):
    """Reads one dataset; all errors are DataErrors that name file, expectation, finding and remedy."""

    root: Path
    place: Path  # tells what is read from all else: the root, or a folder in it where a root holds several versions
    taxonomy: Taxonomy
    max_gap: float  # s between two key frames of a track that still tell its velocity

    def sequences(self, split: str) -> list[str]:
        """The split's sequences that are on disk."""
        ...

    def split_sequences(self, split: str) -> list[str]:
        """All of the split's sequences, on disk or not."""
        ...

    def frames(self, split: str) -> list[Frame]:
        """The key frames of a split, by sequence and number: what is trained on, predicted and scored."""
        ...

    def labelled_frames(self, split: str) -> list[Frame]:
        """The key frames of a split whose labels are there; for scoring, which needs no scans."""
        ...

    def key_frames(self, sequence: str) -> list[Frame]:
        """The sweeps of one sequence that are trained on, predicted and scored, by number; all of them annotated."""
        ...

    def annotated(self, sequence: str) -> list[Frame]:
        """The sweeps of one sequence that the dataset annotates, by number: what instance tables are made of."""
        ...

    def frames_of(self, sequence: str) -> list[Frame]:
        """All sweeps of one sequence, by number: the key frames and, where a dataset has any, those between them."""
        ...

    def has_labels(self, sequence: str) -> bool:
        """Whether the sequence's key frames are annotated; those of a test split usually are not."""
        ...

    def sweep(self, frame: Frame) -> Sweep:
        """Read points, pose, time and, where there are any, raw labels."""
        ...

    def labels(self, frame: Frame) -> Int64[Tensor, "points"]:
        """Read the raw labels alone; the scan need not be there."""
        ...

    def poses(self, sequence: str) -> Float64[Tensor, "rows 4 4"]:
        """World_from_sensor by frame number; read when first asked for, and kept."""
        ...

    def sources(self, sequence: str) -> tuple[list[Path], list[Path]]:
        """Files that the sequence's labelled sweeps are made of: large ones, and small ones of this sequence alone."""
        ...

    def box_files(self, sequence: str) -> list[Path]:
        """Files that hold the amodal boxes of the sequence's things; none where it has no boxes."""
        ...

    def sequence_boxes(self, sequence: str) -> SequenceBoxes:
        """Read the amodal boxes in all of the sequence's key frames."""
        ...

    def num_points(self, frame: Frame) -> int:
        """How many points a sweep has, by the size of its file."""
        ...

    def prediction_path(self, folder: Path, frame: Frame) -> Path:
        """Where a submission keeps its labels of a frame."""
        ...

    def read_prediction(self, path: Path) -> Int64[Tensor, "points"]:
        """Read a submission's labels of a frame, as the taxonomy decodes them."""
        ...

    def write_prediction(self, path: Path, labels: Int64[Tensor, "points"]) -> None:
        """Write a submission's labels of a frame, as the taxonomy encodes them."""
        ...

    def submission_notes(self, frames: list[Frame]) -> dict[str, bytes]:
        """What a submission of these frames holds beside their labels: contents by name."""
        ...
