from pathlib import Path

import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from most.datasets.labels import read_labels, write_labels
from most.errors import DataError


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.lists(st.integers(0, 2**32 - 1), max_size=20))
def test_written_labels_are_read_back(tmp_path: Path, values: list[int]) -> None:
    path = tmp_path / "new" / "000000.label"
    raw = torch.tensor(values, dtype=torch.int64)
    write_labels(path, raw)
    assert torch.equal(read_labels(path), raw)
    assert path.stat().st_size == 4 * len(values)
    assert [file.name for file in path.parent.iterdir()] == ["000000.label"]


def test_bytes_are_little_endian(tmp_path: Path) -> None:
    write_labels(tmp_path / "a.label", torch.tensor([(1 << 16) | 10]))
    assert (tmp_path / "a.label").read_bytes() == bytes([10, 0, 1, 0])


def test_faults_are_told(tmp_path: Path) -> None:
    path = tmp_path / "a.label"
    with pytest.raises(DataError, match=r"a\.label: expected a label file, found none"):
        read_labels(path)
    path.write_bytes(b"12345")
    with pytest.raises(DataError, match=r"a\.label: expected a multiple of 4 bytes .* found 5"):
        read_labels(path)
    with pytest.raises(DataError, match=r"a\.label: expected labels in .* found 0\.\.4294967296"):
        write_labels(path, torch.tensor([0, 1 << 32]))
    assert path.read_bytes() == b"12345"
