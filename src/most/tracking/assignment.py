"""Which observation goes on with which track, among those of one class."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment

Pairs = list[tuple[int, int]]  # observation, track; neither occurs twice
Assignment = Callable[
    [
        Float[np.ndarray, "segments tracks"],  # distance, m
        Float[np.ndarray, "tracks"],  # gates: no pair is farther apart, m
        Float[np.ndarray, "segments"],  # scores
    ],
    Pairs,
]


def greedy(
    distance: Float[np.ndarray, "segments tracks"],
    gates: Float[np.ndarray, "tracks"],
    scores: Float[np.ndarray, "segments"],
) -> Pairs:
    """Observations choose the nearest track left, the most confident first, as CenterPoint has it.

    A doubtful detection beside an object thus never takes its track. Among equal scores, which predictions without
    detections all have, the nearest pair is first.
    """
    rows, columns = np.nonzero(distance <= gates)
    taken: dict[int, int] = {}
    tracks = set()
    for index in np.lexsort((columns, rows, distance[rows, columns], -scores[rows])):
        row, column = int(rows[index]), int(columns[index])
        if row not in taken and column not in tracks:
            taken[row] = column
            tracks.add(column)
    return list(taken.items())


def hungarian(
    distance: Float[np.ndarray, "segments tracks"],
    gates: Float[np.ndarray, "tracks"],
    scores: Float[np.ndarray, "segments"],
) -> Pairs:
    """The pairs of least total distance, in gates; to leave a pair apart costs one gate. Scores do not matter."""
    cost = np.fmin(distance / gates, 1.0)  # also where a distance is too large to be a number
    rows, columns = linear_sum_assignment(cost)
    return [
        (int(row), int(column))
        for row, column in zip(rows, columns, strict=True)
        if distance[row, column] <= gates[column]
    ]
