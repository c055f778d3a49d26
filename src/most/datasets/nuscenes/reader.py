"""Panoptic nuScenes: ``root/{version}/*.json``, ``samples``, ``sweeps``, ``lidarseg`` and ``panoptic``.

A sequence is a scene, by its name; its frames are the lidar's sweeps by time, of which about every tenth is an
annotated key frame. A submission keeps a key frame's labels under the token of its sweep.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path

from jaxtyping import Float64, Int64
from torch import Tensor

from most.datasets.nuscenes.boxes import BOX_TABLES, AmodalBoxes, Annotations, join_boxes
from most.datasets.nuscenes.files import count_points, read_classes, read_panoptic, read_scan, write_panoptic
from most.datasets.nuscenes.labels import LabelFiles
from most.datasets.nuscenes.scenes import LidarSweep, Scenes
from most.datasets.nuscenes.splits import VERSIONS, SceneSplits, official_scenes
from most.datasets.reader import Frame
from most.datasets.settings import DatasetSettings
from most.datasets.splits import check_split, present_sequences
from most.datasets.taxonomy import Taxonomy
from most.errors import ConfigError, DataError, check_entries
from most.modal.boxes import SequenceBoxes
from most.structures import Sweep

META = {  # of a submission; the task of tracking is scored in all figures of segmentation, too
    "task": "tracking",
    "use_camera": False,
    "use_lidar": True,
    "use_radar": False,
    "use_map": False,
    "use_external": False,
}
TABLES = ("scene", "sample", "sample_data", "ego_pose", "calibrated_sensor", "sensor", "panoptic")


@dataclass
class NuScenesSettings(DatasetSettings):
    """A nuScenes tree, real or simulated, and which of its scenes to use."""

    root: str = "data/nuscenes"  # holds the version's folder of tables, samples/, sweeps/, panoptic/
    version: str = "v1.0-trainval"
    splits: SceneSplits = field(default_factory=SceneSplits)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.version not in VERSIONS:
            raise ConfigError(f"dataset.version: expected one of {', '.join(VERSIONS)}, found {self.version!r}")

    def official_reader(self) -> "PanopticNuScenes":
        """Make the reader of the tree."""
        return PanopticNuScenes(self.root, self.version, self.splits)


class PanopticNuScenes:
    """Reads one version of nuScenes; :class:`most.datasets.reader.Reader` says what each method promises."""

    max_gap = 0.75  # s; key frames are 0.5 s apart

    def __init__(self, root: str | Path, version: str = "v1.0-trainval", splits: SceneSplits | None = None) -> None:
        self.root = Path(root).expanduser()
        self.version = version
        self.splits = splits or SceneSplits()
        self.taxonomy = Taxonomy.load("nuscenes")
        self.place = self.root / version  # holds the tables
        self._scenes = Scenes(self.place)
        self._annotations = Annotations(self._scenes)
        self._panoptic = LabelFiles(self.root, "panoptic", self._scenes)
        self._lidarseg = LabelFiles(self.root, "lidarseg", self._scenes)
        self._poses: dict[str, Tensor] = {}

    def split_sequences(self, split: str) -> list[str]:
        """All of the split's scenes, on disk or not."""
        check_split(split)
        return self.splits.scenes(self.version, split)

    def sequences(self, split: str) -> list[str]:
        """The split's scenes that are on disk: warns about missing ones, raises a DataError when all are."""
        wanted = self.split_sequences(split)
        present = self._present(split, wanted)
        if not present:
            raise DataError(self._explain_missing(split, wanted))
        for name in present:
            if split != "test" and not self.has_labels(name):
                raise DataError(
                    f"{self.place / 'panoptic.json'}: expected the labels of {name} of the split {split}, found none; "
                    f"add Panoptic nuScenes, or leave the scene out: dataset.splits.{split}=[...]"
                )
        return present

    def frames(self, split: str) -> list[Frame]:
        """All key frames of a split."""
        return [frame for sequence in self.sequences(split) for frame in self.key_frames(sequence)]

    def labelled_frames(self, split: str) -> list[Frame]:
        """All key frames of a split that the table of labels names; for scoring, which needs no sweeps."""
        return [frame for frame in self.frames(split) if self.token(frame) in self._panoptic]

    def key_frames(self, sequence: str) -> list[Frame]:
        """The annotated sweeps of a scene, two a second."""
        return [Frame(sequence, index) for index, sweep in enumerate(self._sweeps(sequence)) if sweep.is_key]

    def annotated(self, sequence: str) -> list[Frame]:
        """The key frames: no other sweep has labels."""
        return self.key_frames(sequence)

    def frames_of(self, sequence: str) -> list[Frame]:
        """All sweeps of a scene, twenty a second."""
        return [Frame(sequence, index) for index in range(len(self._sweeps(sequence)))]

    def has_labels(self, sequence: str) -> bool:
        """Whether the table of panoptic labels knows the scene."""
        return any(sweep.token in self._panoptic for sweep in self._sweeps(sequence))

    def sweep(self, frame: Frame) -> Sweep:
        """Read a sweep with its pose and time, and a key frame with its labels where there are any."""
        row = self._row(frame)
        points = read_scan(self.root / row.filename, row.token)
        labels = self.labels(frame) if row.is_key and self.has_labels(frame.sequence) else None
        if labels is not None:
            check_entries(self._panoptic.path(row.token), len(labels), len(points))
        return Sweep(frame.sequence, frame.index, points, self.poses(frame.sequence)[frame.index], row.time, labels)

    def labels(self, frame: Frame) -> Int64[Tensor, "points"]:
        """Read the panoptic labels of a key frame: category * 1000 + instance."""
        return read_panoptic(self._panoptic.path(self.token(frame)))

    def categories(self, frame: Frame) -> Int64[Tensor, "points"]:
        """Read the categories of nuScenes-lidarseg, which classify what lies in no box or in several, too."""
        return read_classes(self._lidarseg.path(self.token(frame)))

    def boxes(self, frame: Frame) -> AmodalBoxes:
        """The amodal boxes of a key frame, in its sensor frame; none where nothing is annotated."""
        return self._annotations.boxes(self._row(frame).sample, self.poses(frame.sequence)[frame.index])

    def box_files(self, sequence: str) -> list[Path]:
        """The tables of annotations; the test version has none."""
        tables = [self.place / f"{name}.json" for name in BOX_TABLES]
        return tables if all(path.is_file() for path in tables) else []

    def sequence_boxes(self, sequence: str) -> SequenceBoxes:
        """The boxes of a scene's key frames; which numbers their things have in its labels, the tables do not say."""
        frames = self.key_frames(sequence)
        return join_boxes([frame.index for frame in frames], list(map(self.boxes, frames)), self.taxonomy)

    def poses(self, sequence: str) -> Float64[Tensor, "rows 4 4"]:
        """World_from_sensor by frame number, float64; the world is the map's."""
        if sequence not in self._poses:
            self._poses[sequence] = self._scenes.poses(sequence)
        return self._poses[sequence]

    def sources(self, sequence: str) -> tuple[list[Path], list[Path]]:
        """The key frames' sweeps and labels, and the tables, large as they are; nothing small."""
        frames = self.key_frames(sequence)
        files = [self.root / self._row(frame).filename for frame in frames]
        files += [self._panoptic.path(self.token(frame)) for frame in frames]
        for path in files:
            if not path.is_file():
                raise DataError(f"{path}: expected a file of {sequence}, found none; copy the tree again")
        return files + [self.place / f"{name}.json" for name in TABLES], []

    def prediction_path(self, folder: str | Path, frame: Frame) -> Path:
        """Where a submission keeps its labels of a key frame: ``panoptic/SPLIT/TOKEN_panoptic.npz``."""
        return Path(folder) / "panoptic" / self.official_split(frame) / f"{self.token(frame)}_panoptic.npz"

    def num_points(self, frame: Frame) -> int:
        """How many points a sweep has."""
        row = self._row(frame)
        return count_points(self.root / row.filename, row.token)

    def read_prediction(self, path: Path) -> Int64[Tensor, "points"]:
        """Read a submission's labels of a key frame: class * 1000 + instance."""
        return read_panoptic(path)

    def write_prediction(self, path: Path, labels: Int64[Tensor, "points"]) -> None:
        """Write a submission's labels of a key frame."""
        write_panoptic(path, labels)

    def submission_notes(self, frames: list[Frame]) -> dict[str, bytes]:
        """``SPLIT/submission.json``: it is to be scored as tracking, and lidar alone was used."""
        splits = sorted({self.official_split(frame) for frame in frames})
        return {f"{split}/submission.json": json.dumps({"meta": META}).encode() for split in splits}

    def official_split(self, frame: Frame) -> str:
        """What submissions call the split of a frame: val, test or train, with ``mini_`` before in the mini version."""
        names = ("val", "test", "train")
        splits = [name for name in names if frame.sequence in official_scenes(self.version, name)]
        splits += [name for name in names if frame.sequence in self.splits.scenes(self.version, name)]
        if not splits:
            raise DataError(f"{frame.sequence}: expected a scene of a split, found it in none of {self.version}")
        return f"mini_{splits[0]}" if self.version == "v1.0-mini" else splits[0]

    def token(self, frame: Frame) -> str:
        """The token of the frame's row in sample_data."""
        return self._row(frame).token

    def _present(self, split: str, wanted: list[str]) -> list[str]:
        if not wanted or not self.place.is_dir():
            return []
        return present_sequences(self.place, split, wanted, self._is_on_disk)

    def _is_on_disk(self, scene: str) -> bool:
        """Whether a sweep or a label file of any key frame is there: the tables name all scenes."""
        keys = [sweep for sweep in self._scenes.sweeps.get(scene, []) if sweep.is_key]
        files = [self.root / sweep.filename for sweep in keys]
        files += [self._panoptic.path(sweep.token) for sweep in keys if sweep.token in self._panoptic]
        return any(path.is_file() for path in files)

    def _sweeps(self, sequence: str) -> list[LidarSweep]:
        if sequence not in self._scenes.sweeps:
            raise DataError(
                f"{self.place / 'scene.json'}: expected the scene {sequence}, found none of that name; "
                "it may be of another version: dataset.version"
            )
        return self._scenes.sweeps[sequence]

    def _row(self, frame: Frame) -> LidarSweep:
        sweeps = self._sweeps(frame.sequence)
        if not 0 <= frame.index < len(sweeps):
            raise DataError(
                f"{self.place / 'sample_data.json'}: expected a sweep {frame.index} of {frame.sequence}, "
                f"found {len(sweeps)} sweeps"
            )
        return sweeps[frame.index]

    def _explain_missing(self, split: str, wanted: list[str]) -> str:
        scenes = f"{', '.join(wanted[:3])} ..." if wanted else f"{self.version} has none"
        return (
            f"{self.place}: expected scenes of the split {split} ({scenes}), found none of them.\n"
            f"The tree holds {self.version}/*.json, samples/LIDAR_TOP, sweeps/LIDAR_TOP and panoptic/{self.version}; "
            "train and val scenes are in dataset.version=v1.0-trainval (or v1.0-mini), test ones in v1.0-test.\n"
            "Point dataset.root or the environment variable NUSCENES_ROOT at the folder that holds them,\n"
            f"or simulate one: python -m most.simulate simulation=nuscenes out={self.root}"
        )
