"""Writing files so that a reader never sees half of one, and reading what may be none."""

import os
import struct
import tempfile
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

PARTIAL = ".part"
NO_ARCHIVE = (  # all that numpy and zipfile stumble with over foreign bytes
    OSError, EOFError, ValueError, KeyError, TypeError, RuntimeError, AttributeError, MemoryError, SyntaxError,
    ArithmeticError, struct.error, tokenize.TokenError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip


def is_partial(path: Path) -> bool:
    """Whether a file is what a killed writer left behind."""
    return path.name.startswith(".") and path.suffix == PARTIAL


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Give an empty file beside ``path`` to write to; it takes that name when the block ends well, else it goes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=PARTIAL)
    os.close(handle)
    try:
        yield Path(name)
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


@contextmanager
def atomic_write(path: Path, mode: str = "wb") -> Iterator[IO[Any]]:
    """Open a temporary file beside ``path``; it takes that name when the block ends well, and goes when it does not."""
    with atomic_path(path) as part, part.open(mode) as file:
        yield file
        file.flush()
        os.fsync(file.fileno())
