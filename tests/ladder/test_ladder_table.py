"""The printed ladder."""

from most.ladder import format_ladder


def row(pq: float, lstq: float) -> dict[str, dict[str, float]]:
    """A row's report, as far as the table reads it."""
    return {"panoptic": {"pq": pq, "pq_things": 0.25, "miou": 0.5}, "lstq": {"lstq": lstq, "lstq_repaired": lstq}}


def test_differences_are_those_of_rungs_to_either_end() -> None:
    rows = {"ceiling: the truth": row(1, 1), "everything": row(0.75, float("nan")), "only extents": row(0.5, 0.5),
            "the model": row(0.25, 0.125)}  # fmt: skip
    blocks = [[line.split() for line in block.splitlines()] for block in format_ladder(rows).split("\n\n")]
    assert [block[0] for block in blocks] == [
        ["PQ", "PQ", "Th", "mIoU", "LSTQ", "LSTQ", "rep."],
        ["minus", "everything", "PQ", "PQ", "Th", "mIoU", "LSTQ", "LSTQ", "rep."],
        ["minus", "the", "model", "PQ", "PQ", "Th", "mIoU", "LSTQ", "LSTQ", "rep."],
    ]
    assert blocks[0][2] == ["everything", "75.00", "25.00", "50.00", "-", "-"]
    assert [line[:2] for line in blocks[1][1:]] == [["only", "extents"], ["the", "model"]]
    assert blocks[1][1][2:5] == ["-25.00", "+0.00", "+0.00"]
    assert [line[0] for line in blocks[2][1:]] == ["everything", "only"]
    assert blocks[2][2][2:] == ["+25.00", "+0.00", "+0.00", "+37.50", "+37.50"]


def test_the_nuscenes_evaluators_figures_have_their_columns() -> None:
    report = {
        "panoptic": row(1, 1)["panoptic"],
        "tracking": {"lstq": 1.0, "lstq_repaired": 1.0, "pat": 0.5, "pat_repaired": 0.25},
    }
    assert format_ladder({"everything": report, "all but velocity": report}).splitlines()[1].split()[-2:] == [
        "50.00",
        "25.00",
    ]
