"""A plain folder of scans, of any sensor, that belongs to no dataset: what a stream of sweeps is read from."""

import re
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import torch
from jaxtyping import Float32, Float64
from torch import Tensor

from most.datasets.intensities import IntensityScale
from most.datasets.kitti_files import read_rows
from most.datasets.pose_files import read_pose_file
from most.datasets.scan_files import SUFFIXES, check_size, read_scan_file
from most.datasets.scan_times import LONGEST_STEP, check_times
from most.errors import ConfigError, DataError


@dataclass
class ScanFolderSettings:
    """How the files of a folder of scans are to be read."""

    columns: int = 4  # float32 numbers a point in a .bin: x, y, z, then intensity, then what is not read
    intensity_scale: float = 1.0  # the files' intensities are divided by it: 1 as KITTI's, 255 as most sensors' own
    period: float = 0.1  # s between scans where no file tells their times
    poses: str | None = None  # text file, a row a scan: 12 numbers (3 x 4, world from sensor), or TUM's 8
    times: str | None = None  # text file, a row a scan: seconds

    def __post_init__(self) -> None:
        if self.columns < 3:
            raise ConfigError(f"scans.columns: expected at least 3 (x, y, z), found {self.columns}")
        if not 0 < self.period <= LONGEST_STEP:
            raise ConfigError(f"scans.period: expected seconds above 0, {LONGEST_STEP:g} at most, found {self.period}")
        self.intensities()

    def intensities(self) -> IntensityScale:
        """Make what brings the files' intensities to [0, 1]."""
        return IntensityScale(self.intensity_scale, "scans.intensity_scale")


@dataclass
class Scan:
    """One scan of a sensor."""

    name: str  # of its file, without the suffix
    points: Float32[Tensor, "points 4"]  # x, y, z (m, sensor) and intensity in [0, 1]
    pose: Float64[Tensor, "4 4"] | None  # world from sensor
    time: float  # s


class ScanFolder:
    """The scans of a folder in the order of the numbers in their names (2 before 10); each is read when its turn comes.

    ``poses`` is None where the settings name no file; a warning then says what follows from it. DataErrors name the
    file at fault: those of the folder, poses, times and sizes of ``.bin`` files are raised here, others of a scan when
    it is read.
    """

    def __init__(self, folder: str | Path, settings: ScanFolderSettings | None = None) -> None:
        self.folder, self.settings = Path(folder).expanduser(), settings or ScanFolderSettings()
        self.paths = list_scans(self.folder)
        self.poses, self.times = self._read_poses()
        for path in self.paths:
            check_size(path, self.settings.columns)
        self._intensities = self.settings.intensities()

    def __len__(self) -> int:
        return len(self.paths)

    def __getitem__(self, index: int) -> Scan:
        """Read one scan."""
        path, pose = self.paths[index], None if self.poses is None else self.poses[index]
        points = read_scan_file(path, self.settings.columns)
        points[:, 3] = self._intensities.repair(points[:, 3], path)
        return Scan(path.stem, points, pose, float(self.times[index]))

    def __iter__(self) -> Iterator[Scan]:
        """Read one scan after the other."""
        return (self[index] for index in range(len(self)))

    def _read_poses(self) -> tuple[Float64[Tensor, "scans 4 4"] | None, Float64[Tensor, "scans"]]:
        """Read poses and times; the file of times goes before those that stand beside the poses."""
        poses, times = None, torch.arange(len(self), dtype=torch.float64) * self.settings.period
        if self.settings.poses is None:
            warnings.warn(
                f"{self.folder}: no poses: earlier sweeps are not accumulated, since they would smear; each scan is "
                "seen by itself (scans.poses=FILE changes that)",
                stacklevel=3,
            )
        else:
            poses, own_times = read_pose_file(Path(self.settings.poses))
            self._check_count(self.settings.poses, len(poses), "poses")
            times = times if own_times is None else own_times
        if self.settings.times is not None:
            times = read_rows(Path(self.settings.times), 1)[:, 0]
            self._check_count(self.settings.times, len(times), "times")
        if (file := self.settings.times or self.settings.poses) is not None:
            check_times(Path(file), times)
        return poses, times

    def _check_count(self, file: str, found: int, what: str) -> None:
        if found != len(self):
            raise DataError(f"{file}: expected {what} of the {len(self)} scans in {self.folder}, found {found}")


def list_scans(folder: Path) -> list[Path]:
    """The folder's scans by natural name; a DataError where there are none, or two of the same name."""
    if not folder.is_dir():
        raise DataError(f"{folder}: expected a folder of scans, found none")
    files = [path for path in folder.iterdir() if path.is_file() and not path.name.startswith(".")]
    scans = in_order([path for path in files if path.suffix.lower() in SUFFIXES])
    if not scans:
        suffixes = ", ".join(sorted({path.suffix or path.name for path in files})[:8]) or "no files"
        raise DataError(f"{folder}: expected scans ({', '.join(SUFFIXES)}), found {suffixes}")
    if twice := [stem for stem, number in Counter(path.stem for path in scans).items() if number > 1]:
        raise DataError(f"{folder}: expected one scan of each name, found several {twice[0]}.*; move all but one away")
    return scans


def in_order(paths: list[Path]) -> list[Path]:
    """Sort by name: by value where all names are decimal numbers, as times are (0.15 before 0.2), else naturally."""
    times = all(re.fullmatch(r"\d+(\.\d+)?", path.stem) for path in paths)
    return sorted(paths, key=(lambda path: (Decimal(path.stem), path.name)) if times else natural)


def natural(path: Path) -> tuple[list[str | int], str]:
    """The key that sorts names by the numbers in them."""
    parts: list[str | int] = list(re.split(r"(\d+)", path.name))
    parts[1::2] = [int(number) for number in parts[1::2]]
    return parts, path.name
