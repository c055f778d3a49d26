"""A procedural street seen by a lidar, written as a dataset's own tree with the amodal boxes beside it."""

from most.simulation.boxes import Boxes
from most.simulation.settings import SensorSettings, SimulationSettings, TrafficSettings
from most.simulation.simulator import simulate

__all__ = ["Boxes", "SensorSettings", "SimulationSettings", "TrafficSettings", "simulate"]
