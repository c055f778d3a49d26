from collections.abc import Callable
from pathlib import Path

import pytest

from semantickitti_tree import write_sequence, write_tree


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Root of a tree: training 00 (scans 0..3), validation 08 (0..2), test 11 (0..1, no labels)."""
    return write_tree(tmp_path / "semantickitti")


@pytest.fixture
def add_sequence(tree: Path) -> Callable[..., Path]:
    """Write another sequence into the tree."""
    return lambda *arguments, **options: write_sequence(tree, *arguments, **options)
