"""SemanticKITTI: ``root/sequences/NN/{velodyne/*.bin, labels/*.label, calib.txt, poses.txt, times.txt}``.

Poses and times cover the whole drive: more rows than scans are normal. A test split has no labels.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

from jaxtyping import Float64, Int64
from torch import Tensor

from most.datasets.kitti_boxes import read_boxes
from most.datasets.kitti_files import count_points, read_poses, read_scan, read_times
from most.datasets.labels import read_labels, write_labels
from most.datasets.reader import SPLITS, Frame
from most.datasets.settings import DatasetSettings
from most.datasets.splits import check_once, check_split, present_sequences
from most.datasets.taxonomy import Taxonomy
from most.errors import ConfigError, DataError, check_entries
from most.modal.boxes import SequenceBoxes
from most.structures import Sweep


@dataclass
class Splits:
    """Sequences of each split, two digits each; the defaults are the official ones."""

    train: list[str] = field(default_factory=lambda: ["00", "01", "02", "03", "04", "05", "06", "07", "09", "10"])
    val: list[str] = field(default_factory=lambda: ["08"])
    test: list[str] = field(default_factory=lambda: [str(number) for number in range(11, 22)])

    def __post_init__(self) -> None:
        for split in SPLITS:
            names = [str(name) for name in getattr(self, split)]
            if any(not re.fullmatch(r"[0-9]{2}", name) for name in names):
                quoted = ", ".join(f"'{name:0>2}'" for name in names)
                raise ConfigError(
                    f"dataset.splits.{split}: expected quoted sequence names of two digits, found "
                    f"[{', '.join(names)}]; YAML reads an unquoted 07 as the number 7: write [{quoted}]"
                )
            check_once(split, names)


@dataclass
class SemanticKITTISettings(DatasetSettings):
    """A SemanticKITTI tree, real or simulated, and which of its sequences to use."""

    root: str = "data/semantickitti"  # holds sequences/
    splits: Splits = field(default_factory=Splits)
    key_every: int = 1  # every n-th scan is a key frame: 5 makes of ten scans a second a dataset of two

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.key_every < 1:
            raise ConfigError(f"dataset.key_every: expected at least 1, found {self.key_every}")

    def official_reader(self) -> "SemanticKITTI":
        """Make the reader of the tree."""
        return SemanticKITTI(self.root, self.splits, self.key_every)


class SemanticKITTI:
    """Reads a SemanticKITTI tree; :class:`most.datasets.reader.Reader` says what each method promises."""

    max_gap = 0.35  # s; scans are 0.1 s apart

    def __init__(self, root: str | Path, splits: Splits | None = None, key_every: int = 1) -> None:
        """``key_every`` 5 makes a key frame of scans 0, 5, 10, ..."""
        self.root = self.place = Path(root).expanduser()
        self.splits, self.key_every = splits or Splits(), key_every
        self.taxonomy = Taxonomy.load("semantickitti")
        self._poses: dict[str, Tensor] = {}
        self._times: dict[str, Tensor] = {}

    def folder(self, sequence: str) -> Path:
        """The folder of one sequence."""
        return self.root / "sequences" / sequence

    def split_sequences(self, split: str) -> list[str]:
        """All of the split's sequences, on disk or not."""
        check_split(split)
        names: list[str] = getattr(self.splits, split)
        return names

    def sequences(self, split: str) -> list[str]:
        """The split's sequences that are on disk: warns about missing ones, raises a DataError when all are."""
        wanted = self.split_sequences(split)
        present = present_sequences(self.root, split, wanted, lambda name: self.folder(name).is_dir())
        if not present:
            raise DataError(self._explain_missing(split, wanted))
        for name in present:
            if split != "test" and not self.has_labels(name):
                raise DataError(
                    f"{self.folder(name) / 'labels'}: expected the labels of a sequence of the split {split}, found no "
                    f"folder; add them, or leave the sequence out: dataset.splits.{split}=[...]"
                )
        return present

    def frames(self, split: str) -> list[Frame]:
        """The key frames of a split."""
        return [frame for sequence in self.sequences(split) for frame in self.key_frames(sequence)]

    def labelled_frames(self, split: str) -> list[Frame]:
        """All key frames of a split that have a label file; for scoring, which needs no scans."""
        return [frame for name in self.sequences(split) for frame in self._keys(self._list(name, "labels", "label"))]

    def key_frames(self, sequence: str) -> list[Frame]:
        """The scans of a sequence that are trained on, predicted and scored: all, or every ``key_every``-th."""
        return self._keys(self.frames_of(sequence))

    def annotated(self, sequence: str) -> list[Frame]:
        """All scans of a sequence: each of them has labels."""
        return self.frames_of(sequence)

    def frames_of(self, sequence: str) -> list[Frame]:
        """All scans of a sequence, by number."""
        return self._list(sequence, "velodyne", "bin")

    def has_labels(self, sequence: str) -> bool:
        """Whether the sequence has a folder of labels."""
        return (self.folder(sequence) / "labels").is_dir()

    def sweep(self, frame: Frame) -> Sweep:
        """Read a scan with its pose, time and labels; non-finite points stay, since every point needs a label."""
        points = read_scan(self._scan_path(frame))
        labels = self.labels(frame) if self.has_labels(frame.sequence) else None
        if labels is not None:
            check_entries(self._label_path(frame), len(labels), len(points))
        pose, time = self.pose(frame), self._row(self.times(frame.sequence), frame, "times.txt")
        return Sweep(frame.sequence, frame.index, points, pose, float(time), labels)

    def labels(self, frame: Frame) -> Int64[Tensor, "points"]:
        """Read the raw labels of a frame."""
        return read_labels(self._label_path(frame))

    def pose(self, frame: Frame) -> Float64[Tensor, "4 4"]:
        """World_from_sensor of one frame."""
        return self._row(self.poses(frame.sequence), frame, "poses.txt")

    def poses(self, sequence: str) -> Float64[Tensor, "rows 4 4"]:
        """World_from_sensor by frame number, float64; the world is the sensor frame of the drive's first scan."""
        if sequence not in self._poses:
            self._poses[sequence] = read_poses(self.folder(sequence))
        return self._poses[sequence]

    def times(self, sequence: str) -> Float64[Tensor, "rows"]:
        """Time of each scan in seconds, by frame number."""
        if sequence not in self._times:
            self._times[sequence] = read_times(self.folder(sequence) / "times.txt")
        return self._times[sequence]

    def sources(self, sequence: str) -> tuple[list[Path], list[Path]]:
        """The scans and label files of a sequence, and its poses, calibration and times."""
        folder, frames = self.folder(sequence), self.frames_of(sequence)
        scans = list(map(self._scan_path, frames))
        labels = [self._label_path(frame) for frame in frames]
        texts = [folder / name for name in ("poses.txt", "calib.txt", "times.txt")]
        for path in labels + texts:
            if not path.is_file():
                raise DataError(f"{path}: expected a file beside the sequence's {len(frames)} scans, found none")
        return scans + labels, texts

    def box_files(self, sequence: str) -> list[Path]:
        """``boxes.npz``, which simulated sequences alone have."""
        path = self.folder(sequence) / "boxes.npz"
        return [path] if path.is_file() else []

    def sequence_boxes(self, sequence: str) -> SequenceBoxes:
        """The boxes of a simulated sequence; instances know theirs by their number."""
        return read_boxes(self.folder(sequence) / "boxes.npz", self.poses(sequence), self.taxonomy)

    def num_points(self, frame: Frame) -> int:
        """How many points a scan has."""
        return count_points(self._scan_path(frame))

    def prediction_path(self, folder: str | Path, frame: Frame) -> Path:
        """Where a submission keeps its labels of a frame."""
        return Path(folder) / "sequences" / frame.sequence / "predictions" / f"{_stem(frame)}.label"

    def read_prediction(self, path: Path) -> Int64[Tensor, "points"]:
        """Read a submission's labels of a frame: the same files as the truth's."""
        return read_labels(path)

    def write_prediction(self, path: Path, labels: Int64[Tensor, "points"]) -> None:
        """Write a submission's labels of a frame."""
        write_labels(path, labels)

    def submission_notes(self, frames: list[Frame]) -> dict[str, bytes]:
        """Nothing: the server takes labels alone."""
        return {}

    def _keys(self, frames: list[Frame]) -> list[Frame]:
        return [frame for frame in frames if frame.index % self.key_every == 0]

    def _scan_path(self, frame: Frame) -> Path:
        return self.folder(frame.sequence) / "velodyne" / f"{_stem(frame)}.bin"

    def _label_path(self, frame: Frame) -> Path:
        return self.folder(frame.sequence) / "labels" / f"{_stem(frame)}.label"

    def _list(self, sequence: str, kind: str, suffix: str) -> list[Frame]:
        folder = self.folder(sequence) / kind
        paths = sorted(folder.glob(f"*.{suffix}"))
        if not paths:
            raise DataError(f"{folder}: expected scans 000000.{suffix} and so on, found none; is the tree complete?")
        for path in paths:
            if not re.fullmatch(r"[0-9]{6}", path.stem):
                raise DataError(f"{path}: expected a name of six digits, found {path.stem!r}; rename or remove it")
        return [Frame(sequence, int(path.stem)) for path in paths]

    def _row(self, table: Tensor, frame: Frame, file: str) -> Tensor:
        if frame.index >= len(table):
            raise DataError(
                f"{self.folder(frame.sequence) / file}: expected a row for scan {_stem(frame)}, found {len(table)} "
                "rows; a row belongs to each scan from 000000 on: copy the whole file"
            )
        return table[frame.index]

    def _explain_missing(self, split: str, wanted: list[str]) -> str:
        return (
            f"{self.root / 'sequences'}: expected sequences of the split {split} ({', '.join(wanted)}), "
            "found none of them.\n"
            "Each is a folder sequences/NN with velodyne/NNNNNN.bin, labels/NNNNNN.label (not for test), calib.txt, "
            "poses.txt and times.txt.\n"
            "Point dataset.root or the environment variable SEMANTICKITTI_ROOT at the folder that holds sequences/,\n"
            f"or simulate one: python -m most.simulate out={self.root}"
        )


def _stem(frame: Frame) -> str:
    """The name of a frame's files, without what follows the dot."""
    return f"{frame.index:06d}"
