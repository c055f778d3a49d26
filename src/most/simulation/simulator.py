"""Simulated sequences in a dataset's own layout, whole sequences at a time."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Protocol

from tqdm import tqdm

from most.simulation.nuscenes import NuScenesTree
from most.simulation.semantickitti import SemanticKITTITree
from most.simulation.settings import SimulationSettings
from most.simulation.world import Scan, World

VERSION = 1  # of the worlds: raise it when the same settings give other bytes


class Tree(Protocol):
    """A layout on disk; it knows what it holds, worlds know nothing of it."""

    def has(self, sequence: str) -> bool:
        """Whether the sequence is finished; a DataError where something else is in its place."""
        ...

    def write(self, sequence: str, world: World, scans: Iterable[Scan]) -> None:
        """Write all scans of a sequence's world, in their order; an interrupted writing leaves no sequence."""
        ...

    def finish(self) -> None:
        """Write what sequences share."""
        ...


def simulate(settings: SimulationSettings, out: Path) -> None:
    """Write the sequences that ``out`` does not have yet; what is there from the same settings is kept.

    Raises DataError where something else is in a sequence's place.
    """
    made_from = fingerprint(settings)
    nuscenes = settings.layout == "nuscenes"
    tree: Tree = NuScenesTree(out, made_from) if nuscenes else SemanticKITTITree(out, made_from)
    missing = [name for name in settings.sequences if not tree.has(name)]
    with tqdm(total=len(missing) * settings.scans, desc="simulate", unit="scan") as progress:
        for name in missing:
            world = World(settings, name)
            tree.write(name, world, _scans(world, settings.scans, progress))
    tree.finish()


def fingerprint(settings: SimulationSettings) -> str:
    """What a sequence is made from, as JSON; sequences beside it make no difference, and the layout shows itself."""
    told = {key: value for key, value in asdict(settings).items() if key not in ("sequences", "layout")}
    return json.dumps({"version": VERSION, **told}, indent=1, sort_keys=True)


def _scans(world: World, count: int, progress: tqdm) -> Iterator[Scan]:
    for index in range(count):
        yield world.scan(index)
        progress.update()
