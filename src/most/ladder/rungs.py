"""Which stages get the truth at a time."""

from dataclasses import dataclass

from most.ladder.scene import Scene, Truth
from most.ladder.substitutions import (
    Peaks,
    Substitution,
    centres,
    extents,
    membership,
    point_semantics,
    velocities,
    voxel_semantics,
)

EVERYTHING = "everything"
MODEL = "the model"
STAGES: dict[str, Substitution] = {  # in the order of inference
    "semantics": point_semantics,
    "centres": centres,
    "extents": extents,
    "velocity": velocities,
    "membership": membership,
}
UNSEEN_STAGES = ("velocity", "membership")  # what stands in for these where no model looked: none, and the nearest


@dataclass(frozen=True)
class Rung:
    """A row of the table."""

    name: str
    substitutions: tuple[Substitution, ...]

    def __call__(self, scene: Scene, truth: Truth) -> Scene:
        """Substitute one after the other."""
        for substitution in self.substitutions:
            scene = substitution(scene, truth)
        return scene


def rungs(has_model: bool, peaks: Peaks) -> list[Rung]:
    """Return the ladder, from the top down; without a model, the rungs that need none."""
    finer: dict[str, tuple[str, Substitution]] = {
        "semantics by voxel": ("semantics", voxel_semantics),
        "centres by heat map": ("centres", peaks),
    }
    ladder = [Rung(EVERYTHING, tuple(STAGES.values()))]
    ladder += [
        Rung(f"{EVERYTHING}, {name}", tuple({**STAGES, stage: other}.values()))
        for name, (stage, other) in finer.items()
    ]
    ladder += [
        Rung(f"all but {name}", tuple(other for stage, other in STAGES.items() if stage != name))
        for name in (STAGES if has_model else UNSEEN_STAGES)
    ]
    if not has_model:
        return ladder
    only = {**STAGES, **{name: other for name, (_, other) in finer.items()}}
    ladder += [Rung(f"only {name}", (other,)) for name, other in only.items()]
    return [*ladder, Rung(MODEL, ())]
