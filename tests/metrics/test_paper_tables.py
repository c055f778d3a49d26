"""The paper's tables from a report: its columns, in its order, and a reason where a figure is none."""

import json
from pathlib import Path

import pytest

from most.datasets.taxonomy import Taxonomy
from most.metrics.paper_tables import PaperRow, paper_rows, why_none
from most.metrics.report import format_row, read_report, write_report

SEGMENTATION = ["PQ", "PQ dagger", "RQ", "SQ", "PQ Th", "RQ Th", "SQ Th", "PQ St", "RQ St", "SQ St", "mIoU"]
FOUR_D = ["LSTQ", "PAT", "S_assoc", "S_cls", "PTQ", "PQ"]
NAN = float("nan")
TRACKING = {
    "lstq": 0.732, "pat": 0.749, "s_assoc": 0.666, "s_cls": 0.804, "ptq": 0.72, "sptq": 0.73, "tq": 0.74,
    "ptq_dagger": 0.75, "motsa": 0.76, "smotsa": 0.77, "motsp": 0.78,
}  # fmt: skip


def report_of(name: str, **sections: dict) -> dict:
    """A report whose figures tell where they come from: PQ 0.76, of things 0.77; classes by their number."""
    panoptic = dict.fromkeys(
        (f"{figure}{part}" for figure in ("pq", "sq", "rq", "miou") for part in ("", "_things", "_stuff")), 0.5
    )
    classes = {name: {"pq": number / 100} for number, name in enumerate(Taxonomy.load(name).class_names[1:], 1)}
    panoptic |= {"pq": 0.76, "pq_things": 0.774, "pq_stuff": 0.739, "pq_dagger": 0.795, "miou": 0.804}
    return {"panoptic": panoptic | {"per_class": classes}} | sections


def test_nuscenes_has_every_column_of_the_paper() -> None:
    segmentation, four_d, beside, classes = paper_rows(report_of("nuscenes", tracking=TRACKING))
    assert list(segmentation.figures) == SEGMENTATION
    assert [segmentation.figures[title] for title in ("PQ", "PQ dagger", "PQ Th", "mIoU")] == [
        0.76,
        0.795,
        0.774,
        0.804,
    ]
    assert list(four_d.figures) == FOUR_D
    assert list(four_d.figures.values()) == [0.732, 0.749, 0.666, 0.804, 0.72, 0.76]
    assert beside.figures["TQ"] == 0.74
    assert list(classes.figures)[:2] == ["barrier", "bicycle"]
    assert list(classes.figures)[-4:] == ["vegetation", "PQ Th", "PQ St", "PQ"]


def test_semantickitti_has_no_pat_and_its_classes_stand_in_the_papers_order() -> None:
    _, four_d, classes = paper_rows(report_of("semantickitti", lstq={"lstq": 0.6, "s_assoc": 0.58, "s_cls": 0.63}))
    assert list(four_d.figures.values()) == [0.6, None, 0.58, 0.63, None, 0.76]
    named = (
        "car truck bicycle motorcycle other-vehicle person bicyclist motorcyclist road sidewalk parking other-ground"
    )
    rest = "building vegetation trunk terrain fence pole traffic-sign"
    assert list(classes.figures)[:-3] == f"{named} {rest}".split()
    assert (classes.figures["truck"], classes.figures["sidewalk"]) == (0.04, 0.11)


def test_a_report_read_back_says_the_same(tmp_path: Path) -> None:
    report = report_of("nuscenes", tracking=TRACKING | {"tq": NAN, "pat": NAN})
    write_report(tmp_path / "metrics.json", report)
    read = read_report(tmp_path / "metrics.json")
    assert paper_rows(read) == paper_rows(report)
    assert list(why_none(read)) == list(why_none(report))
    assert json.dumps(read) != json.dumps(report)


@pytest.mark.parametrize("name", ["semantickitti", "nuscenes"])
def test_tables_fit_a_terminal_and_keep_their_columns(name: str) -> None:
    for row in paper_rows(report_of(name, tracking=TRACKING)):
        title, *lines = format_row(row).splitlines()
        assert title == row.title
        assert all(len(line) <= 120 for line in lines)
        for head, figures in zip(lines[::2], lines[1::2], strict=True):
            assert len(head) == len(figures)
        assert " ".join(lines[1::2]).split() == [f"{100 * figure:.1f}" for figure in row.figures.values()]


def test_a_row_by_hand() -> None:
    row = PaperRow("a table", {"PQ": 0.5, "construction": 1.0, "PAT": None})
    assert format_row(row).splitlines() == ["a table", "     PQ  construction    PAT", "   50.0         100.0      -"]
    assert format_row(row, width=25).splitlines() == [
        "a table", "     PQ  construction", "   50.0         100.0", "    PAT", "      -",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("none", "lines"),
    [
        ([], []),
        (
            ["tq", "pat", "s_assoc", "lstq"],
            ["LSTQ, PAT, S_assoc, TQ: none, since no thing of the truth has enough points"],
        ),
        (["pat"], ["PAT: none, since PQ and TQ are both 0"]),
        (["s_cls", "lstq"], ["LSTQ, S_cls: none, since no point has a known class"]),
        (
            ["ptq", "sptq", "motsa"],
            ["PTQ, sPTQ: none, since the truth has no segment", "MOTSA: none, since the truth has no thing"],
        ),
    ],
)
def test_a_figure_that_is_none_has_a_reason(none: list[str], lines: list[str]) -> None:
    found = list(why_none(report_of("nuscenes", tracking=TRACKING | dict.fromkeys(none, NAN))))
    assert [line[: len(start)] for line, start in zip(found, lines, strict=True)] == lines


def test_a_report_without_4d_figures_has_dashes_and_no_reasons() -> None:
    _, four_d, _ = paper_rows(report_of("semantickitti"))
    assert list(four_d.figures.values()) == [None] * 5 + [0.76]
    assert list(why_none(report_of("semantickitti"))) == []
