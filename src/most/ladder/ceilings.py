"""The truth scored against itself: what no prediction can be expected to exceed.

SemanticKITTI's LSTQ does not give it 1, for three reasons, which as many rows tell apart. A predicted tube is an id,
whatever its classes, and the annotators give ids anew in each class: numbering the truth's tubes apart undoes that.
Scans in which an instance has too few points count on one side only: the repaired figures undo that. And a static
and a moving object may have one id: they are one true tube, but two instances for PQ and for anyone who looks at
them, so what tells them apart is below the tubes' ceiling.
"""

from collections.abc import Callable

from jaxtyping import Int64
from torch import Tensor

from most.datasets.taxonomy import Taxonomy
from most.metrics.sequences import LabelScores

CEILING = "ceiling"  # how the names of these rows begin

Points = Int64[Tensor, "points"]
Renumber = Callable[[Points, Points], Points]  # training ids and raw labels -> labels


class Ceiling:
    """The truth as a prediction of itself."""

    def __init__(self, name: str, taxonomy: Taxonomy, renumber: Renumber) -> None:
        self.name, self.renumber, self.scores = name, renumber, LabelScores(taxonomy)

    def add(self, sequence: str, semantics: Points, labels: Points) -> None:
        """Score a scan's truth."""
        self.scores.update(sequence, semantics, self.renumber(semantics, labels), semantics, labels)


def ceilings(taxonomy: Taxonomy) -> list[Ceiling]:
    """Return the truth as it is; where instances have numbers of a sequence, numbered apart by tube and by instance."""
    code = taxonomy.label

    def numbered(kinds: int, kind: Points, labels: Points) -> Points:
        """Labels whose instances of different kinds have different numbers; 0 stays none."""
        number = code.instance_of(labels)
        return code.join(code.class_of(labels), (number * kinds + kind) * (number != 0))

    def by_tube(semantics: Points, labels: Points) -> Points:
        return numbered(taxonomy.num_classes, semantics, labels)

    def by_instance(_: Points, labels: Points) -> Points:
        return numbered(taxonomy.raw_table_size, code.class_of(labels), labels)

    renumbers: dict[str, Renumber] = {f"{CEILING}: the truth": lambda _, labels: labels}
    if code.unique_in == "sequence":
        renumbers |= {f"{CEILING}: its tubes": by_tube, f"{CEILING}: its instances": by_instance}
    return [Ceiling(name, taxonomy, renumber) for name, renumber in renumbers.items()]
