"""The world's labels in nuScenes' terms: categories, and instances numbered through a scene."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Int64, UInt8, UInt16, UInt32

from most.errors import DataError
from most.simulation.boxes import Boxes

CATEGORIES = (
    *("noise", "animal", "human.pedestrian.adult", "human.pedestrian.child", "human.pedestrian.construction_worker"),
    *("human.pedestrian.personal_mobility", "human.pedestrian.police_officer", "human.pedestrian.stroller"),
    *("human.pedestrian.wheelchair", "movable_object.barrier", "movable_object.debris"),
    *("movable_object.pushable_pullable", "movable_object.trafficcone", "static_object.bicycle_rack"),
    *("vehicle.bicycle", "vehicle.bus.bendy", "vehicle.bus.rigid", "vehicle.car", "vehicle.construction"),
    *("vehicle.emergency.ambulance", "vehicle.emergency.police", "vehicle.motorcycle", "vehicle.trailer"),
    *("vehicle.truck", "flat.driveable_surface", "flat.other", "flat.sidewalk", "flat.terrain", "static.manmade"),
    *("static.other", "static.vegetation", "vehicle.ego"),
)
MEANT = {  # raw ids of SemanticKITTI that the world uses
    "noise": (0,),
    "flat.driveable_surface": (40, 44, 60),
    "flat.sidewalk": (48,),
    "flat.terrain": (72,),
    "static.manmade": (50, 51, 80, 81),
    "static.vegetation": (70, 71),
    "static.other": (99,),
    "vehicle.car": (10, 20, 252, 259),
    "vehicle.bicycle": (11, 31, 253),  # the rider is part of it
    "vehicle.motorcycle": (15, 32, 255),
    "vehicle.truck": (18, 258),
    "vehicle.bus.rigid": (13, 257),
    "human.pedestrian.adult": (30, 254),
}
MOST_INSTANCES = 999  # that a scene's labels can number


@dataclass
class SceneLabels:
    """A scene's boxes at its key frames, and what its points are labelled as."""

    boxes: Boxes  # ``scan`` counts key frames

    @cached_property
    def seen(self) -> np.ndarray:
        """The boxes with points: nuScenes annotates no others."""
        return np.flatnonzero(self.boxes.points > 0)

    @cached_property
    def numbers(self) -> dict[int, int]:
        """Numbers of the instances seen, from 1, in the order of their first boxes."""
        seen = list(dict.fromkeys(self.boxes.instance[self.seen].tolist()))
        if len(seen) > MOST_INSTANCES:
            raise DataError(
                f"simulation.traffic: expected at most {MOST_INSTANCES} things seen in a scene, found {len(seen)}; "
                "make the street less busy or the scene shorter"
            )
        return {instance: number for number, instance in enumerate(seen, 1)}

    def category_of(self, row: int) -> int:
        """The category's id of a box."""
        return category(int(self.boxes.label[row]))

    def panoptic(self, labels: UInt32[np.ndarray, "points"], key_frame: int) -> UInt16[np.ndarray, "points"]:
        """Category * 1000 + number from the world's labels; 0, as the dataset has it, for things without a box."""
        boxed = set(self.boxes.instance[self.seen][self.boxes.scan[self.seen] == key_frame].tolist())
        return _translate(labels, lambda label: self._panoptic(label, boxed)).astype(np.uint16)

    def _panoptic(self, label: int, boxed: set[int]) -> int:
        instance = label >> 16
        return 0 if instance and instance not in boxed else category(label) * 1000 + self.numbers.get(instance, 0)


def categories(labels: UInt32[np.ndarray, "points"]) -> UInt8[np.ndarray, "points"]:
    """The category's id of each point, from the world's labels."""
    return _translate(labels, category).astype(np.uint8)


def category(label: int) -> int:
    """The category's id of one of the world's labels."""
    raw = label & 0xFFFF
    return CATEGORIES.index(next(name for name, known in MEANT.items() if raw in known))


def _translate(labels: UInt32[np.ndarray, "points"], meaning: Callable[[int], int]) -> Int64[np.ndarray, "points"]:
    keys, back = np.unique(labels, return_inverse=True)
    return np.array([meaning(int(key)) for key in keys], np.int64)[back]
