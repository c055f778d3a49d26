"""What a user can cause: each message says what, where, what was expected, what was found, and what to do."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class MostError(Exception):
    """Base of all errors a user can put right; entry points print its message alone and exit with this code."""

    exit_code = 2


class ConfigError(MostError):
    """A configuration value that is unknown, of the wrong type, or out of range."""


class DataError(MostError):
    """A file or folder that is missing or does not hold what its format says."""


class StoppedError(MostError):
    """The user stopped the work; the message says how to go on."""

    def __init__(self, message: str, exit_code: int) -> None:
        """``exit_code`` is 128 and the number of the signal, as shells report it."""
        super().__init__(message)
        self.exit_code = exit_code


class FailedError(MostError):
    """Jobs of a sweep failed; the message says which, and why."""

    exit_code = 1


def said(error: BaseException) -> str:
    """Return an error's own text, also where a loading process sent it here inside its traceback."""
    text = str(error)
    if "Original Traceback" not in text:
        return text
    last = text.rsplit("Traceback (most recent call last):", 1)[1]
    raised = re.search(r"^[\w.]+: (.*)", last, re.MULTILINE | re.DOTALL)  # the frames above it are indented
    return raised[1].strip() if raised else text


@contextmanager
def named(place: object) -> Iterator[None]:
    """Say in a DataError of the work within where it happened."""
    try:
        yield
    except DataError as error:
        raise DataError(f"{place}: {error}") from error


def check_entries(file: object, entries: int, points: int, what: str = "a label", whose: str = "scan") -> None:
    """Refuse a file unless it has as many entries (labels, by default) as its scan has points."""
    if entries != points:
        raise DataError(
            f"{file}: expected {what} for each of the {whose}'s {points} points, found {entries}; one of the two is "
            "cut off, or of another scan or release: copy it again, or predict the scan again"
        )


def check_kept(what: str, found: Any, like: Any, rows: int) -> None:
    """Refuse an array of a state that is to be restored, unless it has ``rows`` rows and is else as ``like``."""
    shape = (rows, *like.shape[1:])
    if not isinstance(found, type(like)) or found.dtype != like.dtype or tuple(found.shape) != shape:
        kind, size = getattr(found, "dtype", type(found).__name__), tuple(getattr(found, "shape", ()))
        raise DataError(
            f"state: {what}: expected {like.dtype} of shape {shape}, found {kind} of shape {size}; restore what "
            "state() returned"
        )
