"""Simulated sequences as a SemanticKITTI tree.

``OUT/sequences/NN/`` holds ``velodyne/000000.bin`` (float32 x, y, z in m, sensor frame, and intensity),
``labels/000000.label`` (uint32 instance << 16 | raw class), ``calib.txt``, ``poses.txt``, ``times.txt``,
``boxes.npz`` (the arrays of ``most.simulation.boxes.Boxes``; loads without pickle) and ``simulation.json`` (what it was
made from).
"""

import shutil
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from jaxtyping import Float

from most.errors import DataError
from most.simulation.boxes import boxes
from most.simulation.world import Scan, World

TR = np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]])  # camera from sensor, KITTI's about
_CAMERA = "718.856 0 607.1928 0 0 718.856 185.2157 0 0 0 1 0"


class SemanticKITTITree:
    """A tree of sequences made from the same settings, each in a folder that is complete or not there."""

    def __init__(self, root: Path, made_from: str) -> None:
        """``made_from`` says in JSON what the sequences are made from."""
        self.root, self.made_from = root, made_from

    def has(self, sequence: str) -> bool:
        """Whether the sequence is finished; a DataError where its folder holds something else."""
        folder = self._folder(sequence)
        if not folder.exists():
            return False
        note = folder / "simulation.json"
        if not note.is_file():
            raise DataError(
                f"{folder}: expected no folder or a simulated sequence, found other files; choose another out"
            )
        if note.read_text() != self.made_from:
            raise DataError(
                f"{note}: expected the settings asked for now, found others; remove the folder or choose another out"
            )
        return True

    def write(self, sequence: str, world: World, scans: Iterable[Scan]) -> None:
        """Write into a folder beside, which takes the sequence's name when it is complete."""
        folder = self._folder(sequence)
        part, written = folder.with_name(f".{sequence}.part"), []
        shutil.rmtree(part, ignore_errors=True)  # of an interrupted run
        for kind in ("velodyne", "labels"):
            (part / kind).mkdir(parents=True)
        for index, scan in enumerate(scans):
            (part / "velodyne" / f"{index:06d}.bin").write_bytes(scan.points.tobytes())
            (part / "labels" / f"{index:06d}.label").write_bytes(scan.labels.tobytes())
            written.append(scan)
        np.savez(part / "boxes.npz", **vars(boxes(world, written)))
        _write_text(part, written)
        (part / "simulation.json").write_text(self.made_from)
        part.rename(folder)

    def finish(self) -> None:
        """Nothing is left to do: sequences know nothing of each other."""

    def _folder(self, sequence: str) -> Path:
        return self.root / "sequences" / sequence


def _write_text(folder: Path, scans: list[Scan]) -> None:
    cameras = [TR @ scan.pose @ np.linalg.inv(TR) for scan in scans]
    (folder / "poses.txt").write_text("".join(_row(camera) + "\n" for camera in cameras))
    (folder / "times.txt").write_text("".join(f"{scan.time:.6e}\n" for scan in scans))
    rows = [f"P{camera}: {_CAMERA}\n" for camera in range(4)]
    (folder / "calib.txt").write_text("".join(rows) + f"Tr: {_row(TR)}\n")


def _row(matrix: Float[np.ndarray, "4 4"]) -> str:
    """The upper three rows of a transformation, as KITTI writes them."""
    return " ".join(f"{number:.12e}" for number in matrix[:3].reshape(-1))
