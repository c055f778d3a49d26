"""Detections beside a prediction: what is written is read, and what is no such file is refused."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from most.errors import DataError
from most.metrics.assignments import Assignments, assignments_path, read_assignments, write_assignments
from most.structures import Detections


def assignments(count: int) -> Assignments:
    detections = Detections(
        torch.arange(count), torch.rand(count), torch.rand(count, 3), torch.rand(count, 3), torch.rand(count, 2)
    )
    return Assignments(detections, torch.rand(count, 3), torch.tensor([-1, count - 1, -1]))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("count", [0, 4])
def test_what_is_written_is_read(tmp_path: Path, count: int, turned: bool) -> None:
    written = assignments(count)
    written.detections.yaws = torch.rand(count) if turned else None
    path = assignments_path(tmp_path / "sequences" / "08" / "predictions" / "000123.label")
    assert path == tmp_path / "sequences" / "08" / "detections" / "000123.npz"
    write_assignments(path, written)
    found = read_assignments(path)
    assert (found.detections.yaws is not None) == turned
    for name, value in vars(written.detections).items():
        assert value is None or torch.equal(getattr(found.detections, name), value)
    assert torch.equal(found.roi, written.roi)
    assert torch.equal(found.assigned, written.assigned)


def without_roi(arrays: dict[str, np.ndarray]) -> None:
    del arrays["roi"]


def with_other_centres(arrays: dict[str, np.ndarray]) -> None:
    arrays["centres"] = arrays["centres"][:1]


def with_too_many_yaws(arrays: dict[str, np.ndarray]) -> None:
    arrays["yaws"] = np.zeros(3)


def with_unknown_detection(arrays: dict[str, np.ndarray]) -> None:
    arrays["assigned"] = np.array([0, 2])


def with_pickled_objects(arrays: dict[str, np.ndarray]) -> None:
    arrays["scores"] = np.array([{}, {}], dtype=object)


def exchanged(name: str, array: object) -> Callable[[dict[str, np.ndarray]], None]:
    """Puts another array in the place of one."""

    def spoil(arrays: dict[str, np.ndarray]) -> None:
        arrays[name] = np.asarray(array)

    return spoil


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (exchanged("classes", 2), r"classes: expected shape \(1,\), found \(\)"),
        (exchanged("classes", [0.5, 1]), "classes: expected whole numbers, found float64"),
        (exchanged("classes", [0, 20]), "classes: expected class ids from 0 to 19, found 0 to 20"),
        (exchanged("classes", [-1, 0]), "classes: expected class ids from 0 to 19, found -1 to 0"),
        (exchanged("centres", np.full((2, 3), np.nan)), "centres: expected finite numbers"),
        (exchanged("scores", ["a", "b"]), "scores: expected numbers, found <U1"),
        (exchanged("roi", np.zeros((2, 3), complex)), "roi: expected numbers, found complex128"),
        (exchanged("assigned", 1), r"assigned: expected a number for each point, found shape \(\)"),
        (exchanged("assigned", [0.5]), "assigned: expected for each point a number .* found float64"),
        (without_roi, "found no roi"),
        (with_other_centres, r"centres: expected shape \(2, 3\), found \(1, 3\)"),
        (with_too_many_yaws, r"yaws: expected shape \(2,\), found \(3,\)"),
        (with_unknown_detection, "assigned: expected .* from -1 to 1"),
        (with_pickled_objects, "allow_pickle"),
    ],
)
def test_other_contents_are_refused(
    tmp_path: Path, spoil: Callable[[dict[str, np.ndarray]], None], message: str
) -> None:
    path = tmp_path / "000000.npz"
    write_assignments(path, assignments(2))
    with np.load(path) as file:
        arrays = dict(file)
    spoil(arrays)
    np.savez(path, **arrays)
    with pytest.raises(DataError, match=rf"000000\.npz: .*{message}"):
        read_assignments(path, 20)


def test_a_compression_that_nobody_knows_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "000000.npz"
    write_assignments(path, assignments(2))
    content = path.read_bytes()
    path.write_bytes(re.sub(rb"(PK\x01\x02.{6})\x08\0", rb"\g<1>c\0", content, flags=re.DOTALL))
    assert path.read_bytes() != content
    with pytest.raises(DataError, match=r"000000\.npz: expected an \.npz file of detections"):
        read_assignments(path)


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "000000.npz"
    write_assignments(path, assignments(2))
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(DataError, match=r"000000\.npz: expected an \.npz file"):
        read_assignments(path)
