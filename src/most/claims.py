"""Folders that a command fills: what it writes there is not mixed with anything else, and it may go on."""

import json
from pathlib import Path
from typing import Any

from most.errors import DataError
from most.files import atomic_write, is_partial


def claim(out: Path, name: str, content: dict[str, Any], others: str) -> None:
    """Note ``content`` in the file ``name`` of a new or empty folder; one that holds the same note is gone on with.

    A folder that was claimed for something else is a DataError, which says that it holds ``others``.
    """
    path, record = out / name, json.dumps(content)
    if out.exists() and not out.is_dir():
        raise DataError(f"{out}: expected a new or empty folder, found a file; choose another out")
    if not path.is_file():
        if out.is_dir() and any(not is_partial(path) for path in out.iterdir()):
            raise DataError(f"{out}: expected a new or empty folder, found other files; choose another out")
        with atomic_write(path, "w") as file:
            file.write(record)
    elif path.read_bytes() != record.encode():
        raise DataError(f"{out}: holds {others} ({_differing(path, content)}); choose another out, or remove it")


def _differing(path: Path, content: dict[str, Any]) -> str:
    """Say which entries of a note are others than these."""
    try:
        found = dict(json.loads(path.read_text()))
    except (ValueError, TypeError, RecursionError):  # whatever it holds, it need not be JSON
        return f"{path.name} is no note of most"
    plain = json.loads(json.dumps(content))
    other = [name for name in {**plain, **found} if name not in found or found[name] != plain.get(name)]
    return f"{path.name} has another {', another '.join(other) or 'order'}"
