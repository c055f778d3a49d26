"""What every dataset is told; each adds its splits, and names its reader."""

from dataclasses import dataclass, replace

from most.datasets.reader import Reader
from most.errors import ConfigError


@dataclass
class DatasetSettings:
    """Where a dataset is, and how to load it."""

    root: str = ""
    sweeps: int = 10  # previous sweeps beside the current one
    batch_size: int = 1
    workers: int = 2  # processes that load; 0 loads in the main process
    cache: bool = False  # keep sweeps in memory, in each worker; for datasets of a few hundred sweeps
    tables: str = "data/tables"  # where tables of modal instances are kept
    min_points: int | None = None  # of an unmatched segment that counts; null: as the official evaluator has it

    def __post_init__(self) -> None:
        for key, lowest in {"sweeps": 0, "batch_size": 1, "workers": 0}.items():
            if getattr(self, key) < lowest:
                raise ConfigError(f"dataset.{key}: expected at least {lowest}, found {getattr(self, key)}")

        if self.min_points is not None and self.min_points < 0:
            raise ConfigError(f"dataset.min_points: expected a number >= 0, found {self.min_points}")

    def reader(self) -> Reader:
        """Make the dataset's reader; nothing is read yet."""
        reader = self.official_reader()
        if self.min_points is not None:
            reader.taxonomy = replace(reader.taxonomy, min_points=self.min_points)
        return reader

    def official_reader(self) -> Reader:
        """Make the reader with the taxonomy as it comes."""
        raise NotImplementedError
