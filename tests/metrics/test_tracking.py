"""PTQ, TQ and PAT: the official evaluator's goldens, cases worked out by hand, and properties."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from golden_cases import golden_paths, name_of, read_golden
from most.metrics.running_tracking import PanopticTracking
from scan_stretches import Scan, renamed, scan_of, sequences_of_scans

pytestmark = pytest.mark.filterwarnings("ignore:The ``compute`` method")  # of torchmetrics: before any update
OFFICIAL_NAMES = {
    "PAT": "pat", "PQ": "pq", "TQ": "tq", "PTQ": "ptq", "sPTQ": "sptq", "PTQ_dagger": "ptq_dagger", "MOTSA": "motsa",
    "sMOTSA": "smotsa", "MOTSP": "motsp",
}  # fmt: skip
OF_OTHER_METRICS = {"LSTQ", "S_assoc", "mIoU"}


def close(value: float, tolerance: float = 1e-6) -> object:
    return pytest.approx(value, abs=tolerance, rel=0, nan_ok=True)


@pytest.mark.parametrize("path", golden_paths("nuscenes_pq", "nuscenes_pat_lstq"), ids=name_of)
def test_goldens(path: Path) -> None:
    golden = read_golden(path)
    expected = golden.expected["tracking"]
    metric = PanopticTracking(list(golden.expected["segmentation"]["per_class"]), range(1, 11), golden.min_points)
    for scan in golden.scans:
        metric.update(scan.sequence, *scan.labels)
    figures, overall = metric.compute(), expected.get("overall") or expected["partial_overall"]
    assert set(overall) <= set(OFFICIAL_NAMES) | OF_OTHER_METRICS
    for name in overall.keys() - OF_OTHER_METRICS:
        assert figures[OFFICIAL_NAMES[name]] == close(overall[name]), name
    for name, row in metric.per_class().items() if "per_class" in expected else ():
        official = expected["per_class"][name]
        assert (row["tracks"], row["switches"]) == (official["tq_num_tracks"], official["ids"]), name
        assert row["soft_switches"] == close(official["soft_ids"]), name
        assert (row["ptq"], row["sptq"]) == (close(official["PTQ"]), close(official["sPTQ"])), name
    if "error" in expected:
        assert figures["tq"] != figures["tq"]
        assert figures["pat"] != figures["pat"]
    assert not figures["tq_repaired"] > 1


VOID, CAR, ROAD = 0, 1, 2  # of the hand-made cases; the car alone is a thing
NAMES, THINGS = ["void", "car", "road"], [CAR]


def tracking(min_points: int = 2) -> PanopticTracking:
    return PanopticTracking(NAMES, THINGS, min_points)


def figures_of(metric: PanopticTracking, *scans: Scan) -> dict[str, float]:
    """The figures of one sequence."""
    for scan in scans:
        metric.update(0, *scan)
    return metric.compute()


def car(pred_class: int, pred_key: int) -> Scan:
    """A car of four points, all of them predicted alike."""
    return scan_of((4, pred_class, pred_key, CAR, 7))


def test_a_car_under_two_keys_and_then_missed() -> None:
    """Labels 11 11 12 and none. PQ: three matches and a miss, 3 / 3.5; no road anywhere: 0.

    TQ: AQ = (2 * 2 / 4 + 1 * 1 / 4) / 4 = 5/16; two changes in three steps, IS = 1/3. PTQ: one switch, (3 - 1) / 3.5.
    """
    figures = figures_of(tracking(), car(CAR, 11), car(CAR, 11), car(CAR, 12), car(VOID, 0))
    tq, pq = math.sqrt(5 / 16 / 3), 3 / 7
    assert figures["pq"] == pytest.approx(pq)
    assert figures["tq"] == figures["tq_repaired"] == pytest.approx(tq)
    assert figures["pat"] == pytest.approx(2 * pq * tq / (pq + tq))
    assert (figures["ptq"], figures["sptq"]) == (pytest.approx(4 / 7), pytest.approx(4 / 7))
    assert figures["ptq_dagger"] == pytest.approx((4 / 7 + 0) / 2)
    assert figures["motsa"] == pytest.approx((3 - 0 - 1) / 4)
    assert figures["motsp"] == 1.0


def test_a_soft_switch_weighs_as_much_as_the_two_overlap_now() -> None:
    """IoU 1 under key 11, then 3/4 under key 12: PTQ = (7/4 - 1) / 2, sPTQ = (7/4 - 3/4) / 2."""
    figures = figures_of(tracking(), car(CAR, 11), scan_of((3, CAR, 12, CAR, 7), (1, VOID, 0, CAR, 7)))
    assert (figures["ptq"], figures["sptq"]) == (0.375, 0.5)


def test_a_gap_breaks_the_track_but_is_no_switch() -> None:
    """Labels 11, none, 12: both steps change, IS = 0; PTQ compares neighbouring scans alone: 2 / 2.5."""
    figures = figures_of(tracking(), car(CAR, 11), car(VOID, 0), car(CAR, 12))
    assert figures["tq"] == 0
    assert figures["ptq"] == pytest.approx(0.8)


def test_a_label_that_is_elsewhere_too_weighs_less() -> None:
    """The car's label is predicted for a piece of road in a second scan, where the car is not: AQ = 1 / (1 + 1)."""
    figures = figures_of(tracking(), car(CAR, 11), scan_of((5, CAR, 11, ROAD, 20)))
    assert figures["tq"] == pytest.approx(math.sqrt(1 / 2))


def test_matches_of_few_points_push_the_official_quality_above_one() -> None:
    """Label 11 has enough points (4 > 3) in one of the two scans where it is matched: F = 1 - 2, AQ = 4 / (2 - 1) / 2.

    Repaired it counts in both: AQ = 4 / 2 / 2.
    """
    scans = car(CAR, 11), scan_of((3, CAR, 11, CAR, 7), (1, VOID, 0, CAR, 7))
    figures = figures_of(tracking(min_points=3), *scans)
    assert figures["tq"] == pytest.approx(math.sqrt(2))
    assert figures["tq_repaired"] == 1.0
    assert figures["pat"] > figures["pat_repaired"]


def test_nothing_found_is_zero_by_zero() -> None:
    """PQ = TQ = 0, so that PAT is 0 / 0."""
    figures = figures_of(tracking(), car(VOID, 0))
    assert (figures["pq"], figures["tq"], figures["pat_repaired"]) == (0, 0, 0)
    assert math.isnan(figures["pat"])


def test_without_a_track_the_tracking_figures_are_not_numbers() -> None:
    figures = figures_of(tracking(), scan_of((4, ROAD, 20, ROAD, 20)))
    assert figures["ptq"] == 1.0
    assert all(math.isnan(figures[name]) for name in ("tq", "pat", "tq_repaired", "pat_repaired", "motsa"))


def test_sequences_may_alternate_and_know_nothing_of_each_other() -> None:
    """The same key in two sequences, each under a label of its own: no switch, and two tracks of quality 1."""
    metric = tracking()
    for _ in range(2):
        metric.update(0, *car(CAR, 11))
        metric.update(1, *car(CAR, 12))
    figures = metric.compute()
    assert (figures["tq"], figures["ptq"]) == (1.0, 1.0)
    assert metric.per_class()["car"]["tracks"] == 2


def test_after_a_reset_nothing_is_remembered() -> None:
    metric = tracking()
    figures_of(metric, car(CAR, 11))
    metric.reset()
    assert figures_of(metric, car(CAR, 12))["ptq"] == 1.0


def test_a_sequence_torn_between_two_is_refused() -> None:
    one, other = tracking(), tracking()
    one.update(3, *car(CAR, 11))
    other.update(3, *car(CAR, 11))
    one.merge_state(other)
    with pytest.raises(ValueError, match="sequence 3: expected all its scans in one process"):
        one.compute()


def test_one_scan_has_no_figures_of_its_own() -> None:
    with pytest.raises(TypeError, match="update"):
        tracking()(0, *car(CAR, 11))


def outcome(metric: PanopticTracking, scans: list[tuple[int, Scan]]) -> str:
    """All figures to the last bit, NaN included."""
    for sequence, scan in scans:
        metric.update(sequence, *scan)
    return repr((metric.compute(), metric.per_class()))


def random_tracking() -> PanopticTracking:
    return PanopticTracking(["void", *"abc"], [1, 2], min_points=2)


@given(sequences_of_scans(), st.permutations([1, 2, 3]), st.permutations([0, 1, 2, 3]))
def test_the_names_of_the_labels_do_not_matter(
    scans: list[tuple[int, Scan]], pred: list[int], truth: list[int]
) -> None:
    one, other = random_tracking(), random_tracking()
    for number, scan in scans:
        one.update(number, *scan)
        other.update(number, *renamed(scan, [0, *pred], truth))
    assert one.compute() == pytest.approx(other.compute(), abs=1e-12, nan_ok=True)


@given(sequences_of_scans())
def test_two_sequences_merge_into_the_whole_exactly(scans: list[tuple[int, Scan]]) -> None:
    one, other = random_tracking(), random_tracking()
    for number, scan in scans:
        (one if number == 0 else other).update(number, *scan)
    one.merge_state(other)
    assert outcome(one, []) == outcome(random_tracking(), scans)


@given(sequences_of_scans())
def test_repaired_track_qualities_are_fractions(scans: list[tuple[int, Scan]]) -> None:
    metric = random_tracking()
    outcome(metric, scans)
    assert not metric.compute()["tq_repaired"] > 1 + 1e-12
