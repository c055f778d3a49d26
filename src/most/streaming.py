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
from jaxtyping import Bool, Float, Int64
from numpy.typing import ArrayLike
from torch import Tensor

from most.assembly import Trained, load_trained
from most.datasets.given_scans import as_pose, as_scan, as_seconds
from most.datasets.intensities import IntensityScale
from most.datasets.scan_times import LONGEST_STEP
from most.datasets.windows import SlidingWindow, Window
from most.device import chosen_device
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
    confidence: Float[Tensor, "points"]  # probability of each point's class; 0 where the network never saw it
    tracks: Tracks  # those that are followed, in the scan's frame; whose ``last_seen`` is now, it shows
    seconds: dict[str, float]  # what it took, by stage: accumulate, network, fusion, tracking

    @property
    def semantics(self) -> Int64[Tensor, "points"]:
        """The class of each point, a training id of the tracker's taxonomy."""
        return self.prediction.panoptic.semantics

    @property
    def ids(self) -> Int64[Tensor, "points"]:
        """The number of the track that each point belongs to, 0 for none.

        What lies nowhere (points that are not finite, or a kilometre away) is followed by no track: where its points
        are said to be a thing, they share a number of this scan alone, which ``tracks`` has not.
        """
        return self.prediction.panoptic.ids


class PanopticTracker:
    """A trained model that labels sequences scan by scan; it keeps a window of sweeps and the live tracks, no more."""

    def __init__(
        self,
        trained: Trained,
        settings: TrackerSettings | None = None,
        device: torch.device | str = "cpu",
        intensity_scale: float = 1.0,
    ) -> None:
        """``settings`` of the association, by default the paper's; ``device``: cpu, cuda, or auto.

        ``intensity_scale`` is the sensor's highest intensity: 1 as KITTI's, 255 as most sensors' own.
        """
        self.predictor, self.taxonomy, self.previous = trained.predictor, trained.taxonomy, trained.sweeps
        self.settings, self.device = settings or TrackerSettings(), chosen_device(str(device))
        self._intensities, self._told = IntensityScale(intensity_scale), set[str]()
        for module in self.predictor.modules().values():
            module.eval().to(self.device)
        self.begin()

    @classmethod
    def from_checkpoint(
        cls,
        path: str | Path,
        settings: TrackerSettings | None = None,
        device: torch.device | str = "cpu",
        intensity_scale: float = 1.0,
    ) -> "PanopticTracker":
        """Load what ``most.train`` wrote; a DataError for any other file, a ConfigError for a device that is not."""
        there = chosen_device(str(device))
        return cls(load_trained(Path(path)), settings, there, intensity_scale)

    def begin(self) -> None:
        """Begin another sequence: nothing came before."""
        self.tracker = new_tracker(self.settings, self.taxonomy)
        self._windows = SlidingWindow(self.previous)
        self._scans, self._time = 0, -math.inf

    def state(self) -> dict[str, Any]:
        """Return all that later scans depend on, in plain types and tensors: ``torch.save`` keeps it."""
        return {"tracker": self.tracker.state(), "scans": self._scans, "time": self._time} | self._windows.state()

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from the ``state`` of a tracker of the same model and settings.

        Another's, or what is no state, is a DataError that changes nothing.
        """
        tracker, windows = new_tracker(self.settings, self.taxonomy), SlidingWindow(self.previous)
        try:
            tracker.restore(state["tracker"])
            windows.restore(state)
            scans, seconds = int(state["scans"]), float(state["time"])
        except (LookupError, TypeError, AttributeError, ValueError, ArithmeticError, RuntimeError) as error:
            raise DataError(
                f"state: expected what state() of a tracker returned, found another ({type(error).__name__}: {error})"
            ) from error
        self.tracker, self._windows, self._scans, self._time = tracker, windows, scans, seconds

    def step(self, points: Array, pose: Array | None = None, timestamp: float | None = None) -> Step:
        """Label the next scan of the sequence.

        ``points``: x, y, z (m, sensor frame, z up) and intensity up to ``intensity_scale``, N x 4, or without it N x 3.
        Points that are not finite, and scans without any, are no error; intensities that are not finite count as 0.
        ``pose``: world_from_sensor, 4 x 4. Without it earlier sweeps are left out of the window, as they would smear
        (a warning says so), and the sensor is taken to stand still.
        ``timestamp``: s, on any clock; by default a tenth of a second after the last. Sweeps of more than ten seconds
        before are left out of the window, and what was followed is lost after ``lost_after`` of the settings.

        A scan that comes late or is of another shape is a DataError that changes nothing: leave it out and go on.
        """
        posed, sweep = self._has_pose(pose), self._sweep(points, pose, timestamp)
        clock = Stopwatch(self.device)
        window = (self._windows if posed else SlidingWindow(0)).window(sweep)
        clock.lap("accumulate")
        step = self.see(window, posed)
        self._take_in(sweep, posed)
        return replace(step, seconds=clock.seconds | step.seconds)

    def accumulate(self, points: Array, pose: Array | None, timestamp: float | None = None) -> None:
        """Take in the next sweep unlabelled: one between those that are asked about, which only fills windows.

        Without a pose it cannot: time goes on, no more.
        """
        posed = self._has_pose(pose)
        self._take_in(self._sweep(points, pose, timestamp), posed)

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
        seen, clock = self._in_range(window), Stopwatch(self.device)
        evidence = self.predictor.see([window.sample().to(self.device)])[0]
        clock.lap("network")
        said = self.predictor.fuse(evidence).to("cpu")
        clock.lap("fusion")
        ids = self.follow(window.sweep, said, posed)
        clock.lap("tracking")
        followed = replace(said, panoptic=Panoptic(said.panoptic.semantics, ids))
        confidence = evidence.probabilities.amax(1).cpu().where(seen, 0.0)
        return Step(followed, confidence, self.tracker.tracks(), clock.seconds)

    def follow(self, sweep: Sweep, said: Prediction, posed: bool = True) -> Int64[Tensor, "points"]:
        """Find what is said of a sweep among the tracks; return the number of each point's track, 0 for none.

        The numbers that ``said`` has do not matter: what was followed before gets the same ones again.
        """
        check_entries("labels", len(said.panoptic.ids), len(sweep.points))
        check_entries("detections", len(said.claimed), len(sweep.points), "an entry")
        points, things = sweep.points[:, :3], self.taxonomy.things
        segments = observe(points, said.panoptic, things, said.detections, said.claimed)
        return segments.rename(self.tracker.step(segments.observations, sweep.pose if posed else None, sweep.time))

    def _in_range(self, window: Window) -> Bool[Tensor, "points"]:
        """Which points of its current sweep the network saw."""
        grid = self.predictor.network.grid
        seen = grid.in_range(window.points[: len(window.sweep.points)])
        if len(seen) and not bool(seen.any()):
            ranges = ", ".join(f"{low:g} to {high:g}" for low, high in zip(grid.lower, grid.upper, strict=True))
            self._warn_once(
                "range",
                f"no point of a scan is in range (x, y, z: {ranges}): are these metres, in the sensor's frame?",
            )
        return seen

    def _has_pose(self, pose: Array | None) -> bool:
        if pose is None and self.previous:
            warnings.warn("no pose: the sweeps before are left out of the window", stacklevel=3)
        return pose is not None

    def _sweep(self, points: Array, pose: Array | None, timestamp: float | None) -> Sweep:
        world = torch.eye(4, dtype=torch.float64) if pose is None else as_pose(pose)
        following = self._time + PERIOD if self._scans else 0.0
        seconds = following if timestamp is None else as_seconds(timestamp)
        self.tracker.check(None if pose is None else world, seconds)  # before the network's work
        if seconds <= self._time:
            raise DataError(f"sweep at {seconds} s: expected a time after the last sweep's {self._time} s")
        scan = as_scan(points)
        scan[:, 3] = self._intensities.repair(scan[:, 3], "points")
        if self._scans and seconds - self._time > LONGEST_STEP:
            self._warn_once(
                "time",
                f"a scan comes {seconds - self._time:.15g} s after the last: give times in seconds, and call begin() "
                "before another sequence",
            )
        return Sweep("", self._scans, scan, world, seconds, None)

    def _warn_once(self, fault: str, message: str) -> None:
        """Warn, but not of the same fault in the next scan."""
        if fault not in self._told:
            self._told.add(fault)
            warnings.warn(message, stacklevel=4)

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
