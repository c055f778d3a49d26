"""The oracle ladder: what each stage of inference costs, found by putting the truth in its place.

``looks`` says what a model sees of a sweep, a ``scene``; ``substitutions`` exchange a stage's result for the truth's,
and ``rungs`` say which at a time. ``climb`` labels, tracks and scores every sweep on every rung with the code that
predicts, and ``ceilings`` scores the truth against itself.
"""

from most.ladder.climb import Ladder, check_labels, climb
from most.ladder.looks import Look, ModelLook, NoModel
from most.ladder.table import format_ladder

__all__ = ["Ladder", "Look", "ModelLook", "NoModel", "check_labels", "climb", "format_ladder"]
