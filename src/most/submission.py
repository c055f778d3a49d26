"""Packages predictions for the benchmarks' servers, and says before what they would refuse or score as wrong."""

import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from jaxtyping import Int64
from torch import Tensor
from tqdm import tqdm

from most.datasets.reader import Frame, Reader
from most.datasets.taxonomy import Taxonomy
from most.errors import DataError, check_entries
from most.files import atomic_write, is_partial

FILE, FOLDER = 0o100644 << 16, 0o40755 << 16 | 0x10  # what they are, and who may read them
EPOCH = (1980, 1, 1, 0, 0, 0)  # the date of every file in an archive: the same predictions give the same bytes


def write_submission(reader: Reader, split: str, folder: Path, out: Path, progress: bool = True) -> None:
    """Check the predictions of a split in ``folder`` and write them to the archive ``out``.

    A DataError lists all that is wrong, not the first of it; nothing is written then.
    """
    there = set(reader.sequences(split))
    if missing := [name for name in reader.split_sequences(split) if name not in there]:
        raise DataError(
            f"{reader.root}: expected all sequences of the split {split}, found no {', '.join(missing)}; "
            f"add them, or say which there are: dataset.splits.{split}=[...]"
        )
    frames = reader.frames(split)
    if wrong := list(find_problems(reader, frames, folder, progress)):
        listed = "\n".join(wrong)
        raise DataError(f"{listed}\n{folder}: expected a valid submission, found the {len(wrong)} problem(s) above")
    notes = reader.submission_notes(frames)
    names = [reader.prediction_path(Path(), frame) for frame in frames]
    with atomic_write(out) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for place in sorted({place for name in (*names, *map(Path, notes)) for place in name.parents} - {Path()}):
            archive.writestr(_entry(f"{place.as_posix()}/"), b"")  # SemanticKITTI's validator asks for the folders
        for name, content in notes.items():
            archive.writestr(_entry(name), content)
        for path in tqdm(names, "package", unit="scan", disable=not progress):
            archive.writestr(_entry(path.as_posix()), (folder / path).read_bytes())


def _entry(name: str) -> zipfile.ZipInfo:
    """A file of the archive, or a folder, whose name ends in a slash."""
    entry = zipfile.ZipInfo(name, EPOCH)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = FOLDER if entry.is_dir() else FILE
    return entry


def find_problems(reader: Reader, frames: Sequence[Frame], folder: Path, progress: bool = True) -> Iterator[str]:
    """Yield a line for each thing that is wrong with the predictions of ``frames``, file by file."""
    paths = {reader.prediction_path(folder, frame): frame for frame in frames}
    for path, frame in tqdm(paths.items(), "check", unit="scan", disable=not progress):
        try:
            labels = reader.read_prediction(path)
            check_entries(path, len(labels), reader.num_points(frame))
            semantics = reader.taxonomy.decode(labels, path)
        except DataError as error:
            yield str(error)
            continue
        yield from (f"{path}: {problem}" for problem in _label_problems(reader.taxonomy, labels, semantics))
    for place in sorted({path.parent for path in paths}):
        others = set(place.iterdir()) - set(paths) if place.is_dir() else set()
        for path in sorted(others):
            if not is_partial(path):
                yield f"{path}: expected the predictions of the split's scans alone, found a file of another"


def _label_problems(
    taxonomy: Taxonomy, labels: Int64[Tensor, "points"], semantics: Int64[Tensor, "points"]
) -> Iterator[str]:
    """Yield what the labels of one scan say that a submission must not."""
    thing, instance = taxonomy.is_thing(semantics), taxonomy.instance_of(labels)
    faults = {
        "void": semantics == 0,
        "thing without an instance (id 0)": thing & (instance == 0),
        "stuff with an instance": ~thing & (semantics != 0) & (instance != 0),
    }
    for name, found in faults.items():
        if count := int(found.sum()):
            yield f"expected no {name}, found {count} such point(s)"
