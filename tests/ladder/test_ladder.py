"""The ladder over short drives, with figures worked out by hand."""

from dataclasses import dataclass, replace

import pytest
import torch
from short_drives import GRID, KITTI, NUSCENES, climbed, drive, no_model

from most.inference import Inference
from most.ladder import NoModel
from most.ladder.rungs import EVERYTHING, MODEL
from most.ladder.scene import Scene, Truth
from most.ladder.substitutions import centres, extents, point_semantics, target_maps, velocities
from most.modal.heatmap import HeatmapTargets
from most.panoptic import Fusion
from most.structures import Instances, Sample

CAR, OTHER_CAR, MOVING_CAR = (1 << 16) | 10, (2 << 16) | 10, (1 << 16) | 252
PERSON, ROAD, SIDEWALK = (1 << 16) | 30, 40, 48
STREET = [(ROAD, (0.0, 20.0, -1.0)), (SIDEWALK, (10.0, 20.0, -1.0))]


@dataclass
class Perfect:
    """A model that knows classes and detections, but takes the points of ``mistaken`` classes for the next class."""

    mistaken: tuple[int, ...] = ()
    grid = GRID
    settings = Inference()
    targets = HeatmapTargets()
    has_model = True

    def __call__(self, sample: Sample, instances: Instances) -> Scene:
        scene = NoModel(GRID, self.settings, KITTI.num_classes)(sample, instances)
        truth = Truth.of(sample, self.labels[sample.index], instances, GRID, KITTI)
        for substitute in (point_semantics, centres, extents, velocities):
            scene = substitute(scene, truth)
        classes = scene.evidence.semantics
        maps = target_maps(instances, scene.evidence.bev_grid, KITTI.things, self.targets)
        wrong = torch.isin(classes, torch.tensor(self.mistaken, dtype=torch.long))
        return replace(scene, maps=maps, evidence=replace(scene.evidence, semantics=classes + wrong.long()))

    def over(self, sweeps: list) -> "Perfect":
        """Told the truth of a drive."""
        self.labels = {sweep.index: sweep.labels for sweep in sweeps}
        return self


def test_everything_substituted_is_the_ceiling() -> None:
    """A car passes a parked one and a person; every class there has PQ 1: four of 19."""
    sweeps = drive([[(CAR, (x, 0, 0)), (OTHER_CAR, (5, 4, 0)), (PERSON, (-3, -5, 0)), *STREET] for x in (0, 1, 2, 3)])
    rows = climbed(sweeps, no_model())
    top = rows[EVERYTHING]
    assert top["panoptic"]["pq"] == top["panoptic"]["miou"] == pytest.approx(4 / 19)
    assert top["panoptic"]["pq_things"] == pytest.approx(2 / 8)
    assert top["lstq"]["lstq"] == top["lstq"]["lstq_repaired"] == 1
    assert top == rows["ceiling: its instances"]


@pytest.mark.parametrize(("least", "found"), [(4, 1 / 8), (5, 0)])
def test_heat_maps_are_drawn_as_the_model_learned_them(least: int, found: float) -> None:
    """Cars of four points; a model that was taught those of five and more leaves them together, without ids."""
    settings = Inference(fusion=Fusion(unclaimed="zero"))
    look = replace(no_model(), settings=settings, targets=HeatmapTargets(min_points=least))
    rows = climbed(drive([[(CAR, (0, 0, 0)), (OTHER_CAR, (8, 0, 0)), *STREET]]), look)
    assert rows[EVERYTHING]["panoptic"]["pq_things"] == pytest.approx(1 / 8)
    assert rows[f"{EVERYTHING}, centres by heat map"]["panoptic"]["pq_things"] == pytest.approx(found)


def test_ids_of_two_classes_and_of_two_objects_lower_the_ceiling() -> None:
    """Car 1, person 1 and moving car 1: four points each, in two scans, always at the same places.

    The truth's tubes are car 1 (16 points) and person 1 (8). The truth as a prediction is one tube of 24: each shares
    all it has, S_assoc = (16/24 + 8/24) / 2 = 1/2. Numbered by tube it is 1. By instance, either car has 8 of the
    car's 16: 2 * (8/16) * 8/16 = 1/2, and (1/2 + 1) / 2 = 3/4; and that is what everything substituted gives.
    """
    rows = climbed(drive([[(CAR, (0, 0, 0)), (MOVING_CAR, (8, 0, 0)), (PERSON, (0, 8, 0)), *STREET]] * 2), no_model())
    found = {name: row["lstq"]["s_assoc"] for name, row in rows.items()}
    assert found["ceiling: the truth"] == 1 / 2
    assert found["ceiling: its tubes"] == 1
    assert found["ceiling: its instances"] == found[EVERYTHING] == 3 / 4
    assert all(rows[name]["panoptic"]["pq"] == pytest.approx(4 / 19) for name in rows if "ceiling" in name)


def test_scans_with_too_few_points_count_on_one_side_unless_repaired() -> None:
    """A car of eight points, then of four; more than four are needed. 8/8 is shared with a prediction of 12: 2/3."""
    taxonomy = replace(KITTI, min_points=4)
    twice = [(CAR, (0, 0, 0)), (CAR, (0.1, 0, 0)), (ROAD, (0, 20, -1)), (ROAD, (1, 20, -1))]
    rows = climbed(drive([twice, twice[1:]]), no_model(taxonomy), taxonomy)
    for name in ("ceiling: the truth", "ceiling: its tubes", EVERYTHING):
        assert rows[name]["lstq"]["s_assoc"] == pytest.approx(2 / 3)
        assert rows[name]["lstq"]["s_assoc_repaired"] == 1


def test_everything_substituted_is_the_ceiling_of_the_nuscenes_evaluator() -> None:
    """Two fine classes of pedestrians have an index each of their own; car, pedestrian and road are 3 of 16."""
    car, adult, child, road = 17001, 2001, 3001, 24000
    sweeps = drive([[(car, (4.0 * t, 0, 0)), (adult, (0, 5, 0)), (child, (0, 8, 0)), (road, (0, 20, -1))]
                    for t in range(4)], period=0.5)  # fmt: skip
    rows = climbed(sweeps, no_model(NUSCENES), NUSCENES)
    assert [name for name in rows if "ceiling" in name] == ["ceiling: the truth"]
    for row in (rows["ceiling: the truth"], rows[EVERYTHING]):
        pq = row["panoptic"]["pq"]
        assert pq == pytest.approx(3 / 16)
        assert row["tracking"]["tq"] == 1
        assert row["tracking"]["pat"] == pytest.approx(2 * pq / (pq + 1))
        assert row["tracking"]["s_assoc"] == 1


def test_without_velocities_a_car_takes_the_track_of_the_one_ahead() -> None:
    """Cars 4 m apart drive 4 m a scan: each stands where the other was, and only its velocity tells."""
    sweeps = drive([[(CAR, (4.0 * t, 0, 0)), (OTHER_CAR, (4.0 * t + 4, 0, 0)), *STREET] for t in range(4)])
    rows = climbed(sweeps, no_model())
    assert rows[EVERYTHING]["lstq"]["s_assoc"] == 1
    assert rows["all but velocity"]["lstq"]["s_assoc"] < 0.8
    figures = [rows[name]["panoptic"]["pq"] for name in (EVERYTHING, "all but velocity")]
    assert figures[0] == figures[1]


def test_a_model_without_error_is_at_the_top_of_every_rung() -> None:
    sweeps = drive([[(OTHER_CAR, (x, 0, 0)), (PERSON, (0, -8, 0)), *STREET] for x in (0.0, 1.0)])
    rows = climbed(sweeps, Perfect().over(sweeps))
    assert MODEL in rows
    assert {row["panoptic"]["pq"] for row in rows.values()} == {rows[EVERYTHING]["panoptic"]["pq"]}
    assert {row["lstq"]["lstq"] for row in rows.values()} == {1.0}


def test_one_class_broken_costs_what_it_must_and_no_more() -> None:
    """Road (9) is taken for parking (10): its own figures are lost on the rungs that keep the model's classes."""
    sweeps = drive([[(OTHER_CAR, (x, 0, 0)), (PERSON, (0, -8, 0)), *STREET] for x in (0.0, 1.0)])
    rows = climbed(sweeps, Perfect(mistaken=(9,)).over(sweeps))
    for name, row in rows.items():
        kept = name in (MODEL, "all but semantics") or (name.startswith("only") and "semantics" not in name)
        pq = {key: figures["pq"] for key, figures in row["panoptic"]["per_class"].items()}
        assert pq["road"] == (0 if kept else 1), name
        assert (row["panoptic"]["per_class"]["parking"]["fp"] == 2) == kept, name
        assert pq["car"] == pq["person"] == pq["sidewalk"] == 1
        assert row["lstq"]["s_assoc"] == 1
    cost = rows[EVERYTHING]["panoptic"]["pq"] - rows["all but semantics"]["panoptic"]["pq"]
    assert cost == pytest.approx(1 / 19)
