"""LSTQ: both official evaluators' goldens, cases worked out by hand, and properties."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from golden_cases import golden_paths, name_of, read_golden
from most.metrics.running_tracking import NuScenesLSTQ, SemanticKITTILSTQ
from scan_stretches import Scan, renamed, scan_of, sequences_of_scans

pytestmark = pytest.mark.filterwarnings("ignore:The ``compute`` method")  # of torchmetrics: before any update
KITTI_NAMES = {
    "LSTQ": "lstq", "S_assoc": "s_assoc", "S_cls": "s_cls", "AQ_p": "aq_p", "AQ_r": "aq_r", "iou_p": "iou_p",
    "iou_r": "iou_r", "things_iou": "iou_things", "stuff_iou": "iou_stuff",
}  # fmt: skip
NUSCENES_NAMES = {"LSTQ": "lstq", "S_assoc": "s_assoc", "mIoU": "s_cls"}


def close(value: float, tolerance: float = 1e-9) -> object:
    return pytest.approx(value, abs=tolerance, rel=0, nan_ok=True)


@pytest.mark.parametrize("path", golden_paths("semantickitti_pq", "semantickitti_lstq"), ids=name_of)
def test_semantickitti_goldens(path: Path) -> None:
    golden = read_golden(path)
    expected = golden.expected["lstq"]
    metric = SemanticKITTILSTQ(list(expected["per_class"]), range(1, 9), golden.min_points)
    for scan in golden.scans:
        metric.update(scan.sequence, *scan.ids)
    figures = metric.compute()
    assert set(expected["overall"]) == set(KITTI_NAMES)
    for name, value in expected["overall"].items():
        assert figures[KITTI_NAMES[name]] == close(value), name
    for name, row in metric.per_class().items():
        official = expected["per_class"][name]
        assert row["tubes"] == official["num_tubes"], name
        assert [row["assoc"], row["assoc_sum"], row["iou"]] == [
            close(official[key]) for key in ("assoc", "assoc_sum", "IoU")
        ], name
    assert metric.confusion.tolist() == expected["confusion_rows_pred_cols_gt"]
    assert not figures["s_assoc_repaired"] > 1
    assert not figures["aq_p_repaired"] > 1 + 1e-12


@pytest.mark.parametrize("path", golden_paths("nuscenes_pq", "nuscenes_pat_lstq"), ids=name_of)
def test_nuscenes_goldens(path: Path) -> None:
    golden = read_golden(path)
    expected = golden.expected["tracking"]
    metric = NuScenesLSTQ(list(golden.expected["segmentation"]["per_class"]), range(1, 11), golden.min_points)
    for scan in golden.scans:
        metric.update(scan.sequence, *scan.ids)
    figures, overall = metric.compute(), expected.get("overall") or expected["partial_overall"]
    for name, ours in NUSCENES_NAMES.items():
        assert figures[ours] == close(overall[name], 1e-6), name
    for name, row in metric.per_class().items() if "per_class" in expected else ():
        official = expected["per_class"][name]
        assert row["tubes"] == official["lstq_num_tubes"], name
        assert row["assoc_sum"] == close(official["lstq_assoc_sum"], 1e-6), name
    assert not figures["s_assoc_repaired"] > 1


VOID, CAR, ROAD = 0, 1, 2  # of the hand-made cases; the car alone is a thing
NAMES, THINGS = ["void", "car", "road"], [CAR]


def figures_of(metric: SemanticKITTILSTQ | NuScenesLSTQ, *scans: Scan) -> dict[str, float]:
    """The figures of one sequence."""
    for scan in scans:
        metric.update(0, *scan)
    return metric.compute()


def test_a_car_that_changes_its_id_half_way() -> None:
    """4 + 4 points, each half a tube of its own with IoU 4 / 8: S_assoc = (4 * 1/2 + 4 * 1/2) / 8 = 1/2; S_cls = 1."""
    scans = [scan_of((4, CAR, found, CAR, 7), (2, ROAD, 0, ROAD, 0)) for found in (1, 2)]
    figures = figures_of(SemanticKITTILSTQ(NAMES, THINGS, min_points=1), *scans)
    assert (figures["s_assoc"], figures["s_cls"], figures["lstq"]) == (0.5, 1.0, math.sqrt(0.5))
    assert (figures["aq_p"], figures["aq_r"]) == (1.0, 0.5)
    assert (figures["s_assoc_repaired"], figures["lstq_repaired"]) == (0.5, math.sqrt(0.5))


def test_semantickitti_ids_on_points_predicted_void_are_shared_but_have_no_size() -> None:
    """A car of 4 points under one id, 3 of them void: |p| = 1, shared 4, "IoU" 4 / (4 + 1 - 4), S_assoc = 4 * 4 / 4.

    Repaired: 1 shared point, IoU 1 / 4, by 4 points. S_cls: the car's 1 / 4 and void's 0, halved.
    """
    scan = scan_of((1, CAR, 5, CAR, 7), (3, VOID, 5, CAR, 7))
    figures = figures_of(SemanticKITTILSTQ(NAMES, THINGS, min_points=1), scan)
    assert (figures["s_assoc"], figures["s_assoc_repaired"]) == (4.0, 1 / 16)
    assert (figures["aq_p"], figures["aq_p_repaired"]) == (4.0, 1.0)
    assert figures["s_cls"] == 1 / 8
    assert (figures["lstq"], figures["lstq_repaired"]) == (math.sqrt(1 / 2), math.sqrt(1 / 128))


def test_semantickitti_stuff_with_ids_adds_to_the_sum_only() -> None:
    """A car and a road, both found whole: (1 + 1) by one tube of things; repaired 1."""
    scan = scan_of((4, CAR, 5, CAR, 7), (4, ROAD, 6, ROAD, 8))
    figures = figures_of(SemanticKITTILSTQ(NAMES, THINGS, min_points=1), scan)
    assert (figures["s_assoc"], figures["s_assoc_repaired"]) == (2.0, 1.0)


def test_nuscenes_predictions_of_too_few_points_are_shared_but_have_no_size() -> None:
    """A car of 4 + 4 points, of which 4 and 2 are found, 2 being too few to count: |p| = 4, shared 6.

    S_assoc = 6 * 6 / (8 + 4 - 6) / 8 = 3/4; repaired 4 * 4 / (8 + 4 - 4) / 8 = 1/4. S_cls: the car's 6/8 and the
    absent road's 0, halved.
    """
    scans = [scan_of((4, CAR, 1001, CAR, 17001)), scan_of((2, CAR, 1001, CAR, 17001), (2, VOID, 0, CAR, 17001))]
    figures = figures_of(NuScenesLSTQ(NAMES, THINGS, min_points=2), *scans)
    assert (figures["s_assoc"], figures["s_assoc_repaired"], figures["s_cls"]) == (0.75, 0.25, 0.375)
    assert figures["lstq"] == math.sqrt(0.75 * 0.375)


@pytest.mark.parametrize("kind", [SemanticKITTILSTQ, NuScenesLSTQ])
def test_the_same_id_in_another_sequence_is_another_tube(kind: type) -> None:
    metric = kind(NAMES, THINGS, min_points=1)
    for sequence in (0, 1):
        metric.update(sequence, *scan_of((4, CAR, 5, CAR, 7)))
    assert metric.compute()["s_assoc"] == 1.0
    assert metric.per_class()["car"]["tubes"] == 2


@pytest.mark.parametrize("kind", [SemanticKITTILSTQ, NuScenesLSTQ])
def test_without_a_tube_it_is_not_a_number_but_the_classes_are(kind: type) -> None:
    figures = figures_of(kind(NAMES, THINGS, min_points=1), scan_of((4, ROAD, 0, ROAD, 0)))
    assert all(math.isnan(figures[name]) for name in ("lstq", "s_assoc", "lstq_repaired", "s_assoc_repaired"))
    assert figures["s_cls"] == (1.0 if kind is SemanticKITTILSTQ else 0.5)


def test_without_any_scan_nothing_is_a_number() -> None:
    figures = SemanticKITTILSTQ(NAMES, THINGS).compute()
    assert all(math.isnan(figures[name]) for name in ("lstq", "s_assoc", "s_cls"))


def test_after_a_reset_nothing_is_left() -> None:
    metric, other = (SemanticKITTILSTQ(NAMES, THINGS, min_points=1) for _ in range(2))
    figures_of(metric, scan_of((4, CAR, 5, CAR, 7)))
    metric.reset()
    second = scan_of((2, CAR, 6, CAR, 7), (2, CAR, 5, CAR, 7))
    assert figures_of(metric, second) == figures_of(other, second)


def outcome(metric: SemanticKITTILSTQ | NuScenesLSTQ, scans: list[tuple[int, Scan]]) -> str:
    """All figures to the last bit, NaN included."""
    for sequence, scan in scans:
        metric.update(sequence, *scan)
    return repr((metric.compute(), metric.per_class()))


@given(sequences_of_scans(), st.permutations([1, 2, 3]), st.permutations([1, 2, 3]))
def test_the_names_of_the_ids_do_not_matter(scans: list[tuple[int, Scan]], pred: list[int], truth: list[int]) -> None:
    others = [(number, renamed(scan, [0, *pred], [0, *truth])) for number, scan in scans]
    for kind in (SemanticKITTILSTQ, NuScenesLSTQ):
        one, other = kind(["void", *"abc"], [1, 2], 2), kind(["void", *"abc"], [1, 2], 2)
        for (number, scan), (_, changed) in zip(scans, others, strict=True):
            one.update(number, *scan)
            other.update(number, *changed)
        assert one.compute() == pytest.approx(other.compute(), abs=1e-12, nan_ok=True)


@given(sequences_of_scans(), st.integers(0, 8))
def test_two_parts_of_whatever_scans_merge_into_the_whole_exactly(scans: list[tuple[int, Scan]], cut: int) -> None:
    for kind in (SemanticKITTILSTQ, NuScenesLSTQ):
        whole, one, other = (kind(["void", *"abc"], [1, 2], 2) for _ in range(3))
        for number, scan in scans[cut:]:
            other.update(number, *scan)
        for number, scan in scans[:cut]:
            one.update(number, *scan)
        one.merge_state(other)
        assert outcome(one, []) == outcome(whole, scans[::-1])


@given(sequences_of_scans())
def test_repaired_associations_are_fractions(scans: list[tuple[int, Scan]]) -> None:
    for kind in (SemanticKITTILSTQ, NuScenesLSTQ):
        metric = kind(["void", *"abc"], [1, 2], 2)
        outcome(metric, scans)
        assert not metric.compute()["s_assoc_repaired"] > 1 + 1e-12
