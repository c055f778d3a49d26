"""Links: an object found in two key frames that follow one another. A tracker keeps its identity there, or not."""

from collections.abc import Mapping
from dataclasses import dataclass

from most.metrics.tracking import Track


@dataclass(frozen=True)
class Links:
    """How many links there were, and in how many the identity stayed."""

    kept: int = 0
    switched: int = 0

    def __add__(self, other: "Links") -> "Links":
        return Links(self.kept + other.kept, self.switched + other.switched)

    @staticmethod
    def between(before: Mapping[Track, int], now: Mapping[Track, int]) -> "Links":
        """Count from one key frame to the next; both say which predicted identity an object was found under."""
        same = [before[track] == now[track] for track in before.keys() & now.keys()]
        return Links(sum(same), len(same) - sum(same))
