"""Simulated sequences as a SemanticKITTI tree, whole sequences at a time.

``OUT/sequences/NN/`` holds ``velodyne/000000.bin`` (float32 x, y, z in m, sensor frame, and intensity),
``labels/000000.label`` (uint32 instance << 16 | raw class), ``calib.txt``, ``poses.txt``, ``times.txt``,
``boxes.npz`` (the arrays of ``most.simulation.boxes.Boxes``; loads without pickle) and ``simulation.json`` (what it was
made from).
"""

import json
import shutil
from dataclasses import asdict
from pathlib import Path

import numpy as np
from jaxtyping import Float
from tqdm import tqdm

from most.errors import DataError
from most.simulation.boxes import boxes
from most.simulation.settings import SimulationSettings
from most.simulation.world import Scan, World

VERSION = 1  # of the worlds: raise it when the same settings give other bytes
TR = np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]])  # camera from sensor, KITTI's about
_CAMERA = "718.856 0 607.1928 0 0 718.856 185.2157 0 0 0 1 0"


def simulate(settings: SimulationSettings, out: Path) -> None:
    """Write the sequences that ``out`` does not have yet; what is there from the same settings is kept.

    Raises DataError where a sequence's folder holds something else.
    """
    folders = {name: out / "sequences" / name for name in settings.sequences}
    missing = [name for name, folder in folders.items() if not _finished(folder, fingerprint(settings))]
    with tqdm(total=len(missing) * settings.scans, desc="simulate", unit="scan") as progress:
        for name in missing:
            _write_sequence(settings, name, folders[name], progress)


def fingerprint(settings: SimulationSettings) -> str:
    """What a sequence is made from, as JSON; the other sequences beside it make no difference."""
    told = {key: value for key, value in asdict(settings).items() if key != "sequences"}
    return json.dumps({"version": VERSION, **told}, indent=1, sort_keys=True)


def _finished(folder: Path, expected: str) -> bool:
    if not folder.exists():
        return False
    note = folder / "simulation.json"
    if not note.is_file():
        raise DataError(f"{folder}: expected no folder or a simulated sequence, found other files; choose another out")
    if note.read_text() != expected:
        raise DataError(
            f"{note}: expected the settings asked for now, found others; remove the folder or choose another out"
        )
    return True


def _write_sequence(settings: SimulationSettings, name: str, folder: Path, progress: tqdm) -> None:
    """Write into a folder beside, which takes the sequence's name when it is complete."""
    part = folder.with_name(f".{name}.part")
    shutil.rmtree(part, ignore_errors=True)  # of an interrupted run
    for kind in ("velodyne", "labels"):
        (part / kind).mkdir(parents=True)
    world, scans = World(settings, name), []
    for index in range(settings.scans):
        scan = world.scan(index)
        (part / "velodyne" / f"{index:06d}.bin").write_bytes(scan.points.tobytes())
        (part / "labels" / f"{index:06d}.label").write_bytes(scan.labels.tobytes())
        scans.append(scan)
        progress.update()
    np.savez(part / "boxes.npz", **vars(boxes(world, scans)))
    _write_text(part, scans)
    (part / "simulation.json").write_text(fingerprint(settings))
    part.rename(folder)


def _write_text(folder: Path, scans: list[Scan]) -> None:
    cameras = [TR @ scan.pose @ np.linalg.inv(TR) for scan in scans]
    (folder / "poses.txt").write_text("".join(_row(camera) + "\n" for camera in cameras))
    (folder / "times.txt").write_text("".join(f"{scan.time:.6e}\n" for scan in scans))
    rows = [f"P{camera}: {_CAMERA}\n" for camera in range(4)]
    (folder / "calib.txt").write_text("".join(rows) + f"Tr: {_row(TR)}\n")


def _row(matrix: Float[np.ndarray, "4 4"]) -> str:
    """The upper three rows of a transformation, as KITTI writes them."""
    return " ".join(f"{number:.12e}" for number in matrix[:3].reshape(-1))
