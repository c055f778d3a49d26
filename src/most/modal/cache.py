"""Keeping instance tables and their boxes on disk, a file a sequence, rebuilt when what they were made from changes."""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from tqdm import tqdm

from most.errors import DataError
from most.files import NO_ARCHIVE, atomic_write
from most.modal.boxes import InstanceBoxes, SequenceBoxes, boxes_of_rows
from most.modal.build import LabelRules, build_table
from most.modal.instances import InstanceTable
from most.modal.outline import Outlines
from most.structures import Sweep

Kept = TypeVar("Kept", InstanceTable, InstanceBoxes)
FORMAT = 1  # of the file and of the numbers in it: count up when either changes


def fingerprint(files: Sequence[Path], contents: Sequence[Path], settings: Mapping[str, Any]) -> str:
    """Return a digest of what a table is made from.

    ``files`` (scans, labels) count by name, size and time of change, ``contents`` (poses, calibration, times) by their
    bytes, and ``settings`` (taxonomy) by value: anything that JSON can hold. Folders do not count: a tree may move.
    """
    stats = [(file.name, (stat := file.stat()).st_size, stat.st_mtime_ns) for file in files]
    digests = [hashlib.sha256(file.read_bytes()).hexdigest() for file in contents]
    made_from = json.dumps([FORMAT, stats, digests, settings], sort_keys=True)
    return hashlib.sha256(made_from.encode()).hexdigest()


def cached_table(
    path: Path, made_from: str, sweeps: Iterable[Sweep], num_sweeps: int, rules: LabelRules
) -> InstanceTable:
    """Return the table at ``path`` if it was made from ``made_from`` (a fingerprint), else build it and keep it there.

    ``sweeps`` is read only when building, under a progress bar of ``num_sweeps``. A file that is damaged or something
    else altogether is replaced. Raises DataError where ``path`` cannot be written.
    """
    made_from = f"{made_from} max_gap={rules.max_gap}"
    table = load(InstanceTable, path, made_from)
    if table is None:
        progress = tqdm(sweeps, f"instances of {path.stem}", num_sweeps, unit="sweep", leave=False)
        table = build_table(iter(progress), rules)
        save(table, path, made_from)
    return table


def cached_boxes(path: Path, made_from: str, table: InstanceTable, boxes: Callable[[], SequenceBoxes]) -> InstanceBoxes:
    """Return the boxes of a table's rows at ``path``, or find them among the sequence's and keep them there."""
    found = load(InstanceBoxes, path, made_from)
    if found is None:
        found = boxes_of_rows(table, boxes())
        save(found, path, made_from)
    return found


def save(table: InstanceTable | InstanceBoxes, path: Path, made_from: str) -> None:
    """Write a table, or its boxes; DataError where that is impossible."""
    try:
        with atomic_write(path) as file:
            np.savez(file, made_from=np.array(made_from), **_flatten(table))
    except OSError as error:
        raise DataError(f"{path}: expected a place to keep the instance table, found {error}") from error


def load(kind: type[Kept], path: Path, made_from: str) -> Kept | None:
    """Read what ``save`` wrote of that kind; None if there is no file, or a damaged one, or one of something else."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            if str(arrays["made_from"]) != made_from:
                return None
            return _unflatten(
                kind, {name: torch.from_numpy(arrays[name]) for name in arrays.files if name != "made_from"}
            )
    except NO_ARCHIVE:
        return None


def _flatten(table: InstanceTable | InstanceBoxes) -> dict[str, Any]:
    """Return the tensors by name; those of a table's outlines as ``outlines.starts`` and so on."""
    arrays: dict[str, Any] = {}
    for field in fields(table):
        value = getattr(table, field.name)
        if isinstance(value, Outlines):
            arrays |= {f"{field.name}.{part.name}": getattr(value, part.name).numpy() for part in fields(value)}
        else:
            arrays[field.name] = value.numpy()
    return arrays


def _unflatten(kind: type[Kept], arrays: dict[str, torch.Tensor]) -> Kept:
    parts: dict[str, Any] = {}
    for field in fields(kind):
        if field.type is Outlines:
            parts[field.name] = Outlines(*(arrays[f"{field.name}.{part.name}"] for part in fields(Outlines)))
        else:
            parts[field.name] = arrays[field.name]
    return kind(**parts)
