"""Which file labels which sweep: the tables ``panoptic`` and ``lidarseg``."""

from functools import cached_property
from pathlib import Path

from most.datasets.nuscenes.scenes import Scenes
from most.datasets.nuscenes.tables import Table
from most.errors import DataError


class LabelFiles:
    """The label files of one kind, by the token of the sweep they label."""

    def __init__(self, root: Path, kind: str, scenes: Scenes) -> None:
        """``kind`` is the table's name: panoptic or lidarseg."""
        self.root, self.scenes = root, scenes
        self.table = scenes.folder / f"{kind}.json"

    def __contains__(self, token: str) -> bool:
        return token in self._paths

    def path(self, token: str) -> Path:
        """The file that labels a sweep; a DataError where the table names none."""
        if token not in self._paths:
            raise DataError(
                f"{self.table}: expected a row for the sweep {token!r}, found none; only key frames are labelled, and "
                "the official test split is not"
            )
        return self._paths[token]

    @cached_property
    def _paths(self) -> dict[str, Path]:
        """All files; none where a version has no such table, as the test's."""
        if not self.table.is_file():
            return {}
        columns: dict[str, type] = {"sample_data_token": str, "filename": str}
        rows = Table(self.table, columns, unique=columns).rows.values()
        for row in rows:
            self.scenes.check_sweep(row["sample_data_token"], self.table, row["token"])
        return {row["sample_data_token"]: self.root / row["filename"] for row in rows}
