"""The JSON tables of one nuScenes version: lists of rows that name one another by tokens."""

import json
from collections import Counter
from collections.abc import Callable, Collection
from pathlib import Path, PurePosixPath
from typing import Any

from most.errors import DataError

Row = dict[str, Any]


class Table:
    """The rows of one table by token, each with the columns asked for."""

    def __init__(
        self,
        path: Path,
        columns: dict[str, type],
        keep: Callable[[Row], bool] = lambda _: True,
        unique: Collection[str] = (),
    ) -> None:
        """Read ``path``; rows that ``keep`` rejects leave no trace, since the full tables have millions of them.

        ``unique`` are columns in which, besides the token, no two rows agree.
        """
        self.path = path
        self._columns = {"token": str} | columns
        rows = self._read(keep)
        for column in ("token", *unique):
            self._check_unique(rows, column)
        self.rows = {row["token"]: row for row in rows}

    def row(self, token: str, asker: Path, asking: str) -> Row:
        """The row that the row ``asking`` of the table ``asker`` names; a DataError where there is none."""
        if token not in self.rows:
            raise DataError(
                f"{self.path}: expected the row {token!r}, which row {asking!r} of {asker.name} names, found none; "
                "the tables are incomplete or of different versions: copy all of them again"
            )
        return self.rows[token]

    def _check_unique(self, rows: list[Row], column: str) -> None:
        """Raise a DataError where an entry occurs twice."""
        (twice, times), *_ = Counter(row[column] for row in rows).most_common(1) or [("", 0)]
        if times > 1:
            raise DataError(f"{self.path}: expected each {column} once, found {twice} twice; copy the table again")

    def _read(self, keep: Callable[[Row], bool]) -> list[Row]:
        if not self.path.is_file():
            raise DataError(
                f"{self.path}: expected a table of nuScenes, found no file; copy the version's folder again"
            )
        try:
            with self.path.open(encoding="utf-8") as file:
                rows = json.load(file, object_hook=lambda row: self._checked(row) if keep(row) else None)
        except (ValueError, RecursionError) as error:
            raise DataError(
                f"{self.path}: expected JSON, found something else ({error}); the table is cut off: copy it again"
            ) from error
        if not isinstance(rows, list) or not all(row is None or isinstance(row, dict) for row in rows):
            raise DataError(f"{self.path}: expected a list of rows, found something else; copy the table again")
        return [row for row in rows if row is not None]

    def _checked(self, row: Row) -> Row:
        for name, kind in self._columns.items():
            if not isinstance(row.get(name), kind):
                raise DataError(
                    f"{self.path}: row {row.get('token')!r}: {name}: expected {kind.__name__}, "
                    f"found {row.get(name)!r}; copy the table again"
                )
        for name in {"token", "sample_data_token", "filename"} & self._columns.keys():
            self._check_place(row, name)
        return {name: row[name] for name in self._columns}

    def _check_place(self, row: Row, name: str) -> None:
        """Raise a DataError where an entry that becomes the name of a file would lead out of its folder."""
        parts = PurePosixPath(row[name]).parts
        if row[name].startswith("/") or ".." in parts or "\\" in row[name] or (name != "filename" and len(parts) > 1):
            raise DataError(
                f"{self.path}: row {row['token']!r}: {name}: expected a name inside the dataset, found {row[name]!r}; "
                "do not use this tree: copy the official one"
            )
