"""Labels, tracks and scores every sweep on every rung, with the code that predicts."""

from typing import Any

import torch
from jaxtyping import Int64
from torch import Tensor
from tqdm import tqdm

from most.datasets.dataset import InstanceLookup
from most.datasets.reader import Frame, Reader
from most.datasets.taxonomy import Taxonomy
from most.datasets.window_stream import WindowStream
from most.datasets.windows import Window
from most.errors import DataError, named
from most.geometry.similarity import Similarity
from most.inference import Inference
from most.ladder.ceilings import Ceiling, ceilings
from most.ladder.looks import Look
from most.ladder.rungs import Rung, rungs
from most.ladder.scene import Scene, Truth
from most.ladder.substitutions import Peaks
from most.metrics.sequences import LabelScores
from most.panoptic import fuse
from most.relabelling import new_tracker
from most.structures import Sweep
from most.tracking import TrackerSettings, observe


class Ladder:
    """The ceilings, and all rungs below them.

    Sweeps of a sequence come in the order of time. Memory grows with instances, not with sweeps.
    """

    def __init__(
        self,
        taxonomy: Taxonomy,
        instances: InstanceLookup,
        look: Look,
        tracker: TrackerSettings,
        device: torch.device | str = "cpu",
    ) -> None:
        """Everything but tracking and scoring happens on ``device``, where a model must be."""
        self.taxonomy, self.instances, self.look, self.device = taxonomy, instances, look, torch.device(device)
        self.ceilings: list[Ceiling] = ceilings(self.taxonomy)
        settings = look.settings
        peaks = Peaks(settings.detector, settings.roi, list(self.taxonomy.things), look.targets)
        self.climbers = [Climber(rung, self.taxonomy, settings, tracker) for rung in rungs(look.has_model, peaks)]

    def add(self, window: Window) -> None:
        """Score a labelled sweep on all rungs."""
        sweep, sample = window.sweep, window.sample().to(self.device)
        assert sweep.labels is not None
        instances = self.instances(Frame(sweep.sequence, sweep.index), Similarity.identity()).to(self.device)
        truth = Truth.of(sample, sweep.labels.to(self.device), instances, self.look.grid, self.taxonomy)
        scene = self.look(sample, instances)
        for ceiling in self.ceilings:
            ceiling.add(sweep.sequence, truth.semantics.cpu(), sweep.labels)
        for climber in self.climbers:
            climber.add(scene, truth, sweep)

    def report(self) -> dict[str, dict[str, Any]]:
        """Return every row's report by its name, from the top down."""
        top = {ceiling.name: ceiling.scores.report() for ceiling in self.ceilings}
        return top | {climber.rung.name: climber.scores.report() for climber in self.climbers}


class Climber:
    """One rung: inference after its substitutions, a tracker, and the figures of what they write."""

    def __init__(self, rung: Rung, taxonomy: Taxonomy, settings: Inference, tracking: TrackerSettings) -> None:
        self.rung, self.taxonomy, self.settings, self.tracking = rung, taxonomy, settings, tracking
        self.scores = LabelScores(taxonomy)
        self.sequence, self.tracker = "", new_tracker(tracking, taxonomy)

    def add(self, scene: Scene, truth: Truth, sweep: Sweep) -> None:
        """Label, track, encode, decode and score one sweep."""
        if sweep.sequence != self.sequence:
            self.sequence, self.tracker = sweep.sequence, new_tracker(self.tracking, self.taxonomy)
        labels = self._labels(self.rung(scene, truth), sweep)
        semantics = self.taxonomy.decode(labels)
        self.scores.update(sweep.sequence, semantics, labels, truth.semantics.cpu(), truth.labels.cpu())

    def _labels(self, scene: Scene, sweep: Sweep) -> Int64[Tensor, "points"]:
        """Return the labels as a submission holds them, numbered by tracks."""
        things, evidence = list(self.taxonomy.things), scene.evidence
        found = fuse(evidence, things, scene.membership, self.settings.roi, self.settings.fusion).to("cpu")
        segments = observe(evidence.points.cpu(), found.panoptic, things, found.detections, found.claimed)
        with named(f"{sweep.sequence}, scan {sweep.index}"):
            numbers = self.tracker.step(segments.observations, sweep.pose, sweep.time)
        return self.taxonomy.encode(found.panoptic.semantics, segments.rename(numbers))


def check_labels(reader: Reader, split: str) -> None:
    """Refuse a split whose truth is not there."""
    for sequence in reader.sequences(split):
        if not reader.has_labels(sequence):
            raise DataError(f"split={split}: expected labels, found none of {sequence}; choose another split")


@torch.no_grad()
def climb(ladder: Ladder, reader: Reader, split: str, previous: int, ahead: bool) -> None:
    """Score a split, each sweep after ``previous`` ones; ``ahead``: they are read in a process of their own."""
    frames = reader.frames(split)
    for window in tqdm(WindowStream(reader, frames, previous).load(ahead), "oracle", len(frames), unit="sweep"):
        ladder.add(window)
