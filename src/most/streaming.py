"""MOST scan by scan, as a robot sees the world: points in; classes, identities and tracks out.

    tracker = PanopticTracker.from_checkpoint("membership-last.ckpt")
    for points, pose, time in scans:
        step = tracker.step(points, pose, time)

``most.predict`` labels a dataset with the same class, so both say the same of a sequence, bit for bit.
"""

import math
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float, Float32, Float64, Int64
from numpy.typing import ArrayLike
from torch import Tensor

from most.assembly import Trained, load_trained
from most.datasets.kitti_files import check_rigid
from most.datasets.windows import SlidingWindow, Window
from most.errors import DataError, check_entries
from most.inference import Prediction
from most.relabelling import new_tracker
from most.structures import Panoptic, Sweep, Tracks
from most.tracking import TrackerSettings, observe

Array = ArrayLike | Tensor
PERIOD = 0.1  # s between scans whose times are not told


@dataclass
class Step:
    """What is said of one scan; nothing in it depends on a later one. All of it lies on the CPU."""

    prediction: Prediction  # its labels carry the numbers of tracks: 0 for points of no thing
    confidence: Float[Tensor, "points"]  # probability of each point's class; 1 for points out of range
    tracks: Tracks  # those that are followed, in the scan's frame; whose ``last_seen`` is now, it shows
    seconds: dict[str, float]  # what it took, by stage: accumulate, network, fusion, tracking

    @property
    def semantics(self) -> Int64[Tensor, "points"]:
        """The class of each point, a training id of the tracker's taxonomy."""
        return self.prediction.panoptic.semantics

    @property
    def ids(self) -> Int64[Tensor, "points"]:
        """The number of the track that each point belongs to, 0 for none."""
        return self.prediction.panoptic.ids


class PanopticTracker:
    """A trained model that labels sequences scan by scan; it keeps a window of sweeps and the live tracks, no more."""

    def __init__(
        self, trained: Trained, settings: TrackerSettings | None = None, device: torch.device | str = "cpu"
    ) -> None:
        """``settings`` of the association, by default the paper's."""
        self.predictor, self.taxonomy, self.previous = trained.predictor, trained.taxonomy, trained.sweeps
        self.settings, self.device = settings or TrackerSettings(), torch.device(device)
        for module in self.predictor.modules().values():
            module.eval().to(self.device)
        self.begin()

    @classmethod
    def from_checkpoint(
        cls, path: str | Path, settings: TrackerSettings | None = None, device: torch.device | str = "cpu"
    ) -> "PanopticTracker":
        """Load what ``most.train`` wrote; a DataError for any other file."""
        return cls(load_trained(Path(path)), settings, device)

    def begin(self) -> None:
        """Begin another sequence: nothing came before."""
        self.tracker = new_tracker(self.settings, self.taxonomy)
        self._windows = SlidingWindow(self.previous)
        self._scans, self._time = 0, -math.inf

    def state(self) -> dict[str, Any]:
        """Return all that later scans depend on, in plain types and tensors: ``torch.save`` keeps it."""
        return {"tracker": self.tracker.state(), "scans": self._scans, "time": self._time} | self._windows.state()

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from the ``state`` of a tracker of the same model and settings."""
        self.begin()
        self.tracker.restore(state["tracker"])
        self._windows.restore(state)
        self._scans, self._time = state["scans"], state["time"]

    def step(self, points: Array, pose: Array | None = None, timestamp: float | None = None) -> Step:
        """Label the next scan of the sequence.

        ``points``: x, y, z (m, sensor frame, z up) and intensity in [0, 1], N x 4, or without it N x 3. Points that
        are not finite, and scans without any, are no error.
        ``pose``: world_from_sensor, 4 x 4. Without it earlier sweeps are left out of the window, as they would smear
        (a warning says so), and the sensor is taken to stand still.
        ``timestamp``: s, on any clock; by default a tenth of a second after the last.

        A scan that comes late or is of another shape is a DataError that changes nothing: leave it out and go on.
        """
        if pose is None and self.previous:
            warnings.warn("no pose: the sweeps before are left out of the window", stacklevel=2)
        sweep, posed = self._sweep(points, pose, timestamp), pose is not None
        clock = Stopwatch(self.device)
        window = (self._windows if posed else SlidingWindow(0)).window(sweep)
        clock.lap("accumulate")
        step = self.see(window, posed)
        self._take_in(sweep, posed)
        return replace(step, seconds=clock.seconds | step.seconds)

    def accumulate(self, points: Array, pose: Array, timestamp: float | None = None) -> None:
        """Take in the next sweep unlabelled: one between those that are asked about, which only fills windows."""
        self._take_in(self._sweep(points, pose, timestamp), posed=True)

    def recall(
        self,
        said: Prediction,
        points: Array,
        pose: Array | None = None,
        timestamp: float | None = None,
    ) -> None:
        """Take in the next scan, of which ``step`` said something before: it goes on as if it said it now."""
        sweep, posed = self._sweep(points, pose, timestamp), pose is not None
        self.follow(sweep, said, posed)
        self._take_in(sweep, posed)

    @torch.no_grad()
    def see(self, window: Window, posed: bool = True) -> Step:
        """Label a sweep of the sequence, whose window is there; ``posed`` says whether its pose is known."""
        clock = Stopwatch(self.device)
        evidence = self.predictor.see([window.sample().to(self.device)])[0]
        clock.lap("network")
        said = self.predictor.fuse(evidence).to("cpu")
        clock.lap("fusion")
        ids = self.follow(window.sweep, said, posed)
        clock.lap("tracking")
        followed = replace(said, panoptic=Panoptic(said.panoptic.semantics, ids))
        return Step(followed, evidence.probabilities.amax(1).cpu(), self.tracker.tracks(), clock.seconds)

    def follow(self, sweep: Sweep, said: Prediction, posed: bool = True) -> Int64[Tensor, "points"]:
        """Find what is said of a sweep among the tracks; return the number of each point's track, 0 for none.

        The numbers that ``said`` has do not matter: what was followed before gets the same ones again.
        """
        check_entries("labels", len(said.panoptic.ids), len(sweep.points))
        check_entries("detections", len(said.claimed), len(sweep.points), "an entry")
        points, things = sweep.points[:, :3], self.taxonomy.things
        segments = observe(points, said.panoptic, things, said.detections, said.claimed)
        return segments.rename(self.tracker.step(segments.observations, sweep.pose if posed else None, sweep.time))

    def _sweep(self, points: Array, pose: Array | None, timestamp: float | None) -> Sweep:
        world = torch.eye(4, dtype=torch.float64) if pose is None else _as_pose(pose)
        following = self._time + PERIOD if self._scans else 0.0
        seconds = following if timestamp is None else float(timestamp)
        self.tracker.check(None if pose is None else world, seconds)  # before the network's work
        if seconds <= self._time:
            raise DataError(f"sweep at {seconds} s: expected a time after the last sweep's {self._time} s")
        return Sweep("", self._scans, _as_scan(points), world, seconds, None)

    def _take_in(self, sweep: Sweep, posed: bool) -> None:
        """Go on to the next scan."""
        if posed:
            self._windows.add(sweep)
        self._scans, self._time = self._scans + 1, sweep.time


class Stopwatch:
    """Measures how long stages take, also those that a GPU works on by itself."""

    def __init__(self, device: torch.device) -> None:
        self.device, self.seconds = device, dict[str, float]()
        self._last = self._now()

    def lap(self, stage: str) -> None:
        """Note the time since the last stage's end."""
        now = self._now()
        self.seconds[stage], self._last = now - self._last, now

    def _now(self) -> float:
        if self.device.type == "cuda":
            torch.cuda.synchronize(self.device)
        return time.perf_counter()


def _as_scan(points: Array) -> Float32[Tensor, "points 4"]:
    """Return x, y, z and intensity, which is 0 where there is none."""
    scan = torch.as_tensor(points).to("cpu", torch.float32, copy=True)  # the caller may use its memory again
    if scan.ndim != 2 or scan.shape[1] not in (3, 4):
        raise DataError(
            f"points: expected N x 3 (x, y, z) or N x 4 (and intensity), found the shape {tuple(scan.shape)}"
        )
    return torch.nn.functional.pad(scan, (0, 4 - scan.shape[1]))


def _as_pose(pose: Array) -> Float64[Tensor, "4 4"]:
    matrix = torch.as_tensor(pose).to("cpu", torch.float64, copy=True)
    if matrix.shape != (4, 4):
        raise DataError(f"pose: expected world_from_sensor, 4 x 4, found the shape {tuple(matrix.shape)}")
    if bool(matrix.isfinite().all()):
        check_rigid("pose", matrix[None])
        if matrix[3].tolist() != [0, 0, 0, 1]:
            raise DataError(f"pose: expected 0 0 0 1 in the last row, found {matrix[3].tolist()}; is it transposed?")
    return matrix
