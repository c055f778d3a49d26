"""What the benchmarks' validators ask of a package, restated from what they say they check; nothing of ``most`` here.

SemanticKITTI's looks at names and sizes in the archive, nuScenes' at an unpacked folder; what their evaluators would
count as wrong, or stumble over, is asked for as well.
"""

import io
import json
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

TEST_SEQUENCES = range(11, 22)
KITTI_THINGS, KITTI_STUFF = {10, 11, 15, 18, 20, 30, 31, 32}, {40, 44, 48, 49, 50, 51, 70, 71, 72, 80, 81}
INPUTS = {"use_camera", "use_lidar", "use_radar", "use_map", "use_external"}


def semantickitti_faults(package: Path, root: Path) -> Iterator[str]:
    """Yield what is wrong with a package for the test split in ``root``."""
    if package.suffix != ".zip":
        yield f"{package.name}: no .zip"
    with zipfile.ZipFile(package) as archive:
        sizes = {entry.filename: entry.file_size for entry in archive.infolist()}
        if len(sizes) < len(archive.infolist()):
            yield "a name twice"
        wanted = {"sequences/"}
        for sequence in TEST_SEQUENCES:
            wanted |= {f"sequences/{sequence}/", f"sequences/{sequence}/predictions/"}
            for scan in (root / f"sequences/{sequence}/velodyne").iterdir():
                name = f"sequences/{sequence}/predictions/{scan.stem}.label"
                wanted.add(name)
                if sizes.get(name) != scan.stat().st_size // 16 * 4:
                    yield f"{name}: {sizes.get(name)} bytes"
                else:
                    yield from _semantickitti_labels(name, np.frombuffer(archive.read(name), "<u4"))
        yield from (f"{name}: missing or too much" for name in wanted ^ sizes.keys())


def _semantickitti_labels(name: str, labels: np.ndarray) -> Iterator[str]:
    classes, ids = labels & 0xFFFF, labels >> 16
    if not set(classes.tolist()) <= KITTI_THINGS | KITTI_STUFF:
        yield f"{name}: classes"
    if (np.isin(classes, list(KITTI_THINGS)) != (ids > 0)).any():
        yield f"{name}: ids"


def nuscenes_faults(package: Path, root: Path, version: str, split: str, scenes: list[str]) -> Iterator[str]:
    """Yield what is wrong with a package for the key frames of ``scenes``."""
    with zipfile.ZipFile(package) as archive:
        files = [name for name in archive.namelist() if not name.endswith("/")]
        contents = {name: archive.read(name) for name in files}
    if len(contents) < len(files):
        yield "a name twice"
    meta = json.loads(contents.pop(f"{split}/submission.json", b'{"meta": {}}'))["meta"]
    task = meta.pop("task", None)  # what the devkit's evaluator is to run
    if task not in ("segmentation", "tracking"):
        yield f"{split}/submission.json: task {task}"
    if set(meta) != INPUTS or not all(type(value) is bool for value in meta.values()):
        yield f"{split}/submission.json: {meta}"
    points = {f"panoptic/{split}/{token}_panoptic.npz": size for token, size in _key_frames(root / version, scenes)}
    yield from (f"{name}: missing or too much" for name in points.keys() ^ contents.keys())
    for name in points.keys() & contents.keys():
        labels = np.load(io.BytesIO(contents[name]), allow_pickle=False)["data"]
        if labels.dtype != np.uint16 or labels.shape != (points[name],):
            yield f"{name}: {labels.dtype} {labels.shape}"
        if not ((labels // 1000 >= 1) & (labels // 1000 <= 16)).all():
            yield f"{name}: classes"
        if ((labels // 1000 <= 10) != (labels % 1000 > 0)).any():
            yield f"{name}: indices"


def _key_frames(tables: Path, scenes: list[str]) -> Iterator[tuple[str, int]]:
    """The tokens of the scenes' key frames of the lidar, and how many points each has."""
    rows = {name: json.loads((tables / f"{name}.json").read_text()) for name in ("scene", "sample", "sample_data")}
    tokens = {row["token"] for row in rows["scene"] if row["name"] in scenes}
    samples = {row["token"] for row in rows["sample"] if row["scene_token"] in tokens}
    for row in rows["sample_data"]:
        if row["sample_token"] in samples and row["is_key_frame"] and "LIDAR_TOP" in row["filename"]:
            yield row["token"], (tables.parent / row["filename"]).stat().st_size // 20
