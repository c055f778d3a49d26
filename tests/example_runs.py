"""Folders of finished runs as most.train leaves them, with made-up sums: as good as one likes."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from most.datasets.taxonomy import Taxonomy
from most.metrics.segment_sums import DISTANCES, POINTS
from most.metrics.sightings import VISIBLE
from most.reports.table import Table

TAXONOMY = Taxonomy.load("semantickitti")
CLASSES = (1, 2, 6, 9, 13)  # that the sequences have: three things and two of stuff
SEQUENCES = ("09", "10", "11", "12")


def example_sums(
    quality: float, seed: int, sequences: tuple[str, ...] = SEQUENCES, membership: float = 0.9, tracked: bool = False
) -> dict[str, Any]:
    """A section ``sums`` in which a segment is found with the chance ``quality``, as luck has it by ``seed``."""
    luck = np.random.default_rng(seed)
    return {
        "evaluator": TAXONOMY.evaluator,
        "classes": TAXONOMY.class_names,
        "things": TAXONOMY.things,
        "min_points": TAXONOMY.min_points,
        "distance_edges": list(DISTANCES),
        "points_edges": list(POINTS),
        "visible_edges": list(VISIBLE),
        "sequences": {name: _sequence(quality, luck, membership, tracked) for name in sequences},
    }


def _sequence(quality: float, luck: np.random.Generator, membership: float, tracked: bool) -> dict[str, Any]:
    size = TAXONOMY.num_classes
    is_there = np.isin(np.arange(size), CLASSES)
    things = is_there & np.isin(np.arange(size), TAXONOMY.things)
    edges = {"distance": DISTANCES, "points": POINTS, "visible": VISIBLE}
    binned = {key: _segments(quality, luck, things, len(bins)) for key, bins in edges.items()}
    true = 1000 * is_there
    hits = luck.binomial(true, quality)
    found = {name: rows[0] for name, rows in _segments(quality, luck, is_there, 1).items()}
    counts = [int(luck.binomial(500, membership)), 500, int(luck.binomial(50, membership - 0.2)), 50]
    tubes = {"assoc": (quality * 5 * is_there).tolist(), "tubes": (5 * is_there).tolist()} if tracked else {}
    return {
        "scans": 10, **found, "intersection": hits.tolist(), "predicted": true.tolist(), "true": true.tolist(),
        "membership": counts, **binned, **tubes,
    }  # fmt: skip


def _segments(quality: float, luck: np.random.Generator, is_there: Any, bins: int) -> dict[str, Any]:
    true = np.broadcast_to(40 * is_there, (bins, len(is_there)))
    tp = luck.binomial(true, quality)
    fp = luck.binomial(true, 0.2)
    return {"tp": tp.tolist(), "fp": fp.tolist(), "fn": (true - tp).tolist(), "iou": (0.8 * tp).tolist()}


def example_run(
    folder: Path,
    sums: dict[str, Any] | None,
    *,
    seed: int = 1,
    extent: str = "track_max",
    heads: str = "modal_centres",
    membership: str = "full",
    nearest: dict[str, Any] | None = None,
    overrides: tuple[str, ...] = (),
    **config: Any,
) -> Path:
    """Write a run; with ``nearest``, the sums of nearest centres, it is one of both stages. Without ``sums``: none."""
    stages = ["detection"] if nearest is None else ["detection", "membership"]
    settings = {
        "name": "example",
        "seed": seed,
        "dataset": {"root": f"somewhere/{seed}", "sweeps": 0},
        "extent": {"floor": 0.05},
        "backbone": {"widths": [4, 8]},
        "membership": {"widths": [4]},
        "stage": {"run": stages},
    } | config
    choices = {"extent": extent, "heads": heads, "membership": membership}
    choices |= {"dataset": "simulated", "experiment": "sim_demo"}
    runtime = {"choices": choices, "cwd": "/trained", "output_dir": f"/trained/{folder.name}"}
    hydra = {"hydra": {"runtime": runtime}}
    for name, content in {"config": settings, "hydra": hydra, "overrides": list(overrides)}.items():
        path = folder / ".hydra" / f"{name}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(yaml.safe_dump(content))
    if sums is not None:
        report = {"epochs": 2, "panoptic": {"sums": sums}}
        beside = {} if nearest is None else {"panoptic_nearest": {"sums": nearest}}
        (folder / "metrics.json").write_text(json.dumps(report | beside))
    return folder


def example_sweep(folder: Path, seeds: int = 3) -> Path:
    """Table I with both stages, and Table II on MAX; the more of the paper, the better."""
    chances = {"shrink_wrap": 0.6, "drop_small": 0.55, "class_mean": 0.65, "track_max": 0.75, "amodal": 0.8}
    for seed in range(1, seeds + 1):
        for number, (extent, chance) in enumerate(chances.items()):
            example_run(
                folder / "extents" / f"{extent},{seed}", example_sums(chance, 10 * seed + number), seed=seed,
                extent=extent, nearest=example_sums(chance - 0.05, 10 * seed + number, membership=0.7),
            )  # fmt: skip
        for number, membership in enumerate(("geometric", "geometric_bev")):
            example_run(
                folder / "memberships" / str(seed) / membership, example_sums(0.72, 100 * seed + number), seed=seed,
                membership=membership, nearest=example_sums(0.7, 100 * seed + number, membership=0.7),
                stage1=f"track_max,{seed}",
            )  # fmt: skip
    return folder


def ours(table: Table) -> dict[str, dict[str, float]]:
    """The figures of our rows, by title and column."""
    return {
        row.title: {key: cell.value for key, cell in row.cells.items() if cell}
        for block, row in table.rows()
        if block.ours
    }
