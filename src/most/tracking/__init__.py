"""Association of instances over time: observations of sweeps in, identities of tracks out (paper, section III)."""

from most.tracking.motion import ConstantVelocity
from most.tracking.observe import Segments, observe
from most.tracking.settings import TrackerSettings
from most.tracking.tracker import Tracker

__all__ = ["ConstantVelocity", "Segments", "Tracker", "TrackerSettings", "observe"]
