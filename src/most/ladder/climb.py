"""Labels, tracks and scores every sweep on every rung, with the code that predicts."""

from typing import Any

import torch

from most.datasets.reader import Frame, Reader
from most.datasets.taxonomy import Taxonomy
from most.inference import Inference
from most.ladder.ceilings import Ceiling, ceilings
from most.ladder.looks import Look
from most.ladder.rungs import Rung, rungs
from most.ladder.scene import Scene, Truth
from most.ladder.substitutions import Peaks
from most.metrics.sequences import LabelScores
from most.panoptic import fuse
from most.relabelling import new_tracker
from most.structures import Sample, Sweep
from most.tracking import TrackerSettings, observe


class Ladder:
    """The ceilings, and all rungs below them.

    Sweeps of a sequence come in the order of time. Memory grows with instances, not with sweeps.
    """

    def __init__(self, reader: Reader, look: Look, tracker: TrackerSettings) -> None:
        self.reader, self.taxonomy, self.look = reader, reader.taxonomy, look
        self.ceilings: list[Ceiling] = ceilings(self.taxonomy)
        things, settings = list(self.taxonomy.things), look.settings
        peaks = Peaks(settings.detector, settings.roi, things)
        self.climbers = [Climber(rung, self.taxonomy, settings, tracker) for rung in rungs(look.has_model, peaks)]

    def add(self, samples: list[Sample]) -> None:
        """Score the current sweeps of some windows on all rungs."""
        for sample, scene in zip(samples, self.look(samples), strict=True):
            truth = Truth.of(sample, self.look.grid, self.taxonomy)
            sweep = self.reader.sweep(Frame(sample.sequence, sample.index))
            known, labels = truth.semantics.cpu(), truth.labels.cpu()
            for ceiling in self.ceilings:
                ceiling.add(sample.sequence, known, labels)
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

    def _labels(self, scene: Scene, sweep: Sweep) -> torch.Tensor:
        """Return the labels as a submission holds them, numbered by tracks."""
        things, evidence = list(self.taxonomy.things), scene.evidence
        found = fuse(evidence, things, scene.membership, self.settings.roi, self.settings.fusion).to("cpu")
        points, detections = evidence.points.cpu(), evidence.detections.to("cpu")
        segments = observe(points, found.panoptic, things, detections, found.claimed)
        numbers = self.tracker.step(segments.observations, sweep.pose, sweep.time)
        return self.taxonomy.encode(found.panoptic.semantics, segments.rename(numbers))
