"""The paper's tables: its rows and columns, ours and its figures apart, differences by hand, and their files."""

import csv
import json
import re
from pathlib import Path

import pytest
import yaml

from example_runs import example_run, example_sums, example_sweep, ours
from most.errors import ConfigError
from most.metrics.paper_tables import SEGMENTATION, TRACKING
from most.reports import paper
from most.reports.ablations import AMODALIZATION, SMALL, amodalization, memberships
from most.reports.analysis import Analysis
from most.reports.formats import latex, markdown
from most.reports.groups import group
from most.reports.notes import UNSEEN, UNTOLD
from most.reports.orders import order_table, verdict
from most.reports.plots import plots
from most.reports.runs import find_runs
from most.reports.table import Table
from most.reports.tables import ablation_table, benchmark_tables, difference_table, occlusion_tables
from most.reports.write import write_reports


@pytest.fixture(scope="module")
def analysis(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    folder = example_sweep(tmp_path_factory.mktemp("sweep"), seeds=2)
    (found,) = group(find_runs(folder).scored)
    return Analysis(found, draws=200, seed=1)


def test_table_1_has_the_papers_rows_in_its_order(analysis: Analysis) -> None:
    table = ablation_table(amodalization(analysis.group), analysis)
    papers = [row.title for block, row in table.rows() if not block.ours]
    assert [title for title in papers if title in ours(table)] == list(ours(table))
    assert len(ours(table)) == 5
    assert table.columns[:6] == ("PQ", "PQ Th", "PQ St", "mIoU", "mIoU Th", "mIoU St")
    figures = next(row for block, row in table.rows() if not block.ours and row.title == "Modal Det. (MAX)")
    assert figures.cells["PQ"].value == pytest.approx(0.771)
    assert "(full)" in table.notes[0]
    assert SMALL in table.notes


def test_table_2_compares_with_the_nearest_centre_of_the_same_stage_1(analysis: Analysis) -> None:
    table = ablation_table(memberships(analysis.group), analysis)
    assert list(ours(table)) == [
        "Nearest neighbour (baseline)", "PointSegMLP (semantic + geometric)", "+ BEV feat.", "+ Point feat. (full)",
    ]  # fmt: skip
    nearest = ours(table)["Nearest neighbour (baseline)"]["Membership Acc"]
    assert nearest == pytest.approx(0.7, abs=0.05)
    assert "MAX" in table.notes[0]


def test_differences_are_to_the_row_that_was_chosen(analysis: Analysis) -> None:
    ablation = amodalization(analysis.group)
    whole = ours(ablation_table(ablation, analysis))
    for baseline, title in ((None, "Modal Det. (SW), w/ sharing"), ("amodal", "Amodal Det.")):
        table = difference_table(ablation, analysis, baseline)
        assert table.title.endswith(title)
        assert title not in ours(table)
        expected = whole["Modal Det. (MAX)"]["PQ"] - whole[title]["PQ"]
        assert ours(table)["Modal Det. (MAX)"]["PQ"] == pytest.approx(expected)


def test_a_single_row_has_no_differences_and_one_run_no_interval(tmp_path: Path) -> None:
    example_run(tmp_path, example_sums(0.7, 1, sequences=("09",)))
    (found,) = group(find_runs(tmp_path).scored)
    single = Analysis(found, draws=200, seed=1)
    assert difference_table(amodalization(found), single, None) is None
    assert order_table({"table1": amodalization(found), "table2": memberships(found)}, single) is None
    (row,) = (row for block, row in ablation_table(amodalization(found), single).rows() if block.ours)
    assert row.cells["PQ"].low is None


def test_a_figure_that_neither_row_has_is_no_difference(tmp_path: Path) -> None:
    """No sequence has a thing in view in the first bin."""
    for seed, extent in enumerate(("shrink_wrap", "track_max")):
        sums = example_sums(0.7, seed)
        for sequence in sums["sequences"].values():
            for rows in sequence["visible"].values():
                rows[0] = [0] * 20
        example_run(tmp_path / extent, sums, extent=extent)
    (found,) = group(find_runs(tmp_path).scored)
    _, apart = occlusion_tables(amodalization(found), Analysis(found, 200, 1), None)
    (row,) = apart.blocks[0].rows
    assert row.cells["0-20 %"] is None
    assert row.cells["20-40 %"] is not None


def test_few_objects_make_no_figure_of_a_bin(tmp_path: Path) -> None:
    """Nine in the first bin, ten in the second."""
    sums = example_sums(0.7, 1, sequences=("09",))
    seen = sums["sequences"]["09"]["visible"]
    for name in ("tp", "fp", "fn", "iou"):
        seen[name][:2] = [[0] * 20, [0] * 20]
    seen["tp"][0][1], seen["tp"][1][1] = 9, 10
    example_run(tmp_path, sums)
    (found,) = group(find_runs(tmp_path).scored)
    (table,) = occlusion_tables(amodalization(found), Analysis(found, 200, 1), None)
    (row,) = ours(table).values()
    assert "0-20 %" not in row
    assert "20-40 %" in row


def test_occlusion_is_a_table_with_differences_where_runs_know_it(analysis: Analysis, tmp_path: Path) -> None:
    whole, apart = occlusion_tables(amodalization(analysis.group), analysis, "track_max")
    assert whole.columns == apart.columns == ("0-20 %", "20-40 %", "40-60 %", "60-80 %", "80-100 %")
    assert len(ours(whole)) == 5
    assert apart.title.endswith("share of the object that is seen, differences to Modal Det. (MAX)")
    assert ours(apart).keys() == ours(whole).keys() - {"Modal Det. (MAX)"}
    assert ": 480 of 0-20 %" in whole.notes[1]  # 40 of each of three classes in four sequences
    old = example_sums(0.7, 1)
    del old["visible_edges"]
    for sequence in old["sequences"].values():
        del sequence["visible"]
    for seed, sums in ((1, old), (2, example_sums(0.7, 1))):
        example_run(tmp_path / f"{seed}", sums, seed=seed)
    (found,) = group(find_runs(tmp_path).scored)  # of both versions
    (partly,) = occlusion_tables(amodalization(found), Analysis(found, 200, 1), None)
    assert ours(partly) == {"Modal Det. (MAX)": {}}
    assert UNSEEN in partly.notes
    assert UNSEEN not in whole.notes
    example_run(tmp_path / "old", old)
    (found,) = group(find_runs(tmp_path / "old").scored)
    assert occlusion_tables(amodalization(found), Analysis(found, 200, 1), None) == []


def test_predictions_that_do_not_say_how_they_were_made_are_named(tmp_path: Path) -> None:
    example_run(tmp_path, example_sums(0.7, 1))
    (tmp_path / "evaluated").mkdir()
    said = {"prediction": {"membership": "clustering", "changed": ["tracker.motion=kalman"]}}
    for name, told in (("nearest", {}), ("clustering", said)):
        report = {"panoptic": {"sums": example_sums(0.8, 2, tracked=True)}} | told
        (tmp_path / "evaluated" / f"{name}.json").write_text(json.dumps(report))
    (found,) = group(find_runs(tmp_path).scored)
    analysis = Analysis(found, 200, 1)
    notes = ablation_table(memberships(found), analysis).notes
    assert [note for note in notes if UNTOLD in note] == [f"Nearest neighbour (baseline): {UNTOLD}"]
    (table5,) = (table for table in benchmark_tables(analysis) if table.name == "table5")
    assert "Modal Det. (MAX), clustering: tracker.motion=kalman." in table5.notes


def test_orders_are_said_with_their_confidence(analysis: Analysis) -> None:
    parts = {"table1": amodalization(analysis.group), "table2": memberships(analysis.group)}
    table = order_table(parts, analysis)
    assert re.fullmatch(r"shown \((99|100)\.\d % of draws agree\)", table.words["MAX above SW"])
    assert re.match(r"Does the paper's order show\? Of 10: \d+ shown, \d+ reversed, \d+ open", table.title)
    rows = {row.title: row.cells for row in table.blocks[0].rows}
    assert rows["MAX above SW"]["paper: PQ"].value == pytest.approx(0.033)
    assert rows["full above nearest"]["paper: PQ"].value == pytest.approx(0.029)
    assert rows["full above nearest"]["paper: PQ Th"] is None  # Table II has none
    assert rows["full above nearest"]["Membership Acc"].value == pytest.approx(0.2, abs=0.05)
    assert rows["full above nearest"]["paper: Membership Acc"].value == pytest.approx(0.191)
    interval = analysis.differences(
        *(analysis.group.by_seed(each) for each in analysis.group.strategies[:2]), {"": "pq"}
    )
    assert verdict(interval[""], 2)
    assert verdict(None, 0) == "no seed, or no stage 1, in common"


def test_benchmarks_have_the_papers_columns(analysis: Analysis) -> None:
    table4, classes = benchmark_tables(analysis)
    assert (table4.name, table4.columns) == ("table4", tuple(SEGMENTATION))
    assert classes.columns[:3] == ("car", "truck", "bicycle")
    row = next(row for block, row in classes.rows() if block.ours)
    assert row.cells["truck"] is None  # no sequence has one
    assert row.cells["car"].value > 0.3


def test_table_5_is_of_tracked_predictions(tmp_path: Path) -> None:
    example_run(tmp_path, example_sums(0.7, 1, tracked=True))
    (found,) = group(find_runs(tmp_path).scored)
    table = next(table for table in benchmark_tables(Analysis(found, 200, 1)) if table.name == "table5")
    assert table.columns == (*TRACKING, "PQ")
    row = next(row for block, row in table.rows() if block.ours)
    assert row.cells["LSTQ"].low < row.cells["LSTQ"].value < row.cells["LSTQ"].high
    assert row.cells["PAT"] is None
    assert next(row for block, row in table.rows() if row.title == "MOST").cells["LSTQ"].value == pytest.approx(0.603)


def test_the_papers_tables_are_as_wide_as_their_columns_and_means_follow_from_classes() -> None:
    content = yaml.safe_load((Path(paper.__file__).parent / "paper.yaml").read_text())
    for name, table in content.items():
        for row, values in table["rows"].items():
            assert len(values) == len(table["columns"]), (name, row)
            assert all(value is None or 0 < value < 100 for value in values), (name, row)
    assert content["table1"]["columns"] == list(AMODALIZATION)[:6]
    for name, things in (("classes_nuscenes", 10), ("classes_semantickitti", 8)):
        *classes, of_things, of_stuff, of_all = content[name]["rows"]["MOST"]  # of others the paper rounds otherwise
        assert sum(classes[:things]) / things == pytest.approx(of_things, abs=0.06), name
        assert sum(classes[things:]) / len(classes[things:]) == pytest.approx(of_stuff, abs=0.11), name
        assert sum(classes) / len(classes) == pytest.approx(of_all, abs=0.06), name


def test_every_layout_tells_ours_from_the_papers(tmp_path: Path) -> None:
    out = tmp_path / "report"
    write_reports(example_sweep(tmp_path / "runs", seeds=2), out, "drop_small", draws=200, seed=1)
    with (out / "tables/table1.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["from"] for row in rows} == {"ours", "paper"}
    of_max = {row["from"]: row for row in rows if row["row"] == "Modal Det. (MAX)"}
    assert float(of_max["paper"]["PQ"]) == pytest.approx(0.771)
    assert of_max["paper"]["PQ low"] == ""
    assert float(of_max["ours"]["PQ low"]) < float(of_max["ours"]["PQ"]) < float(of_max["ours"]["PQ high"])
    assert of_max["ours"]["seeds"] == "1 2"
    text = (out / "report.md").read_text()
    assert text.index("**Measured here") < text.index("**The paper's own figures")
    assert "differences to Modal Det. (DSB)" in text
    assert f"{100 * float(of_max['ours']['PQ']):.1f} (" in text
    assert sorted(path.stem for path in (out / "plots").iterdir()) == [
        "distance",
        "extents",
        "membership",
        "points",
        "visible",
    ]
    tex = (out / "report.tex").read_text()
    assert tex.count(r"\begin{tabular}") == tex.count(r"\end{tabular}") == 9
    assert not re.search(r"(?<!\\)[_&%#](?![^\n]*\\\\)", re.sub(r"\\label\{.*?\}|^%.*$", "", tex, flags=re.M))


def test_the_same_runs_give_the_same_files(tmp_path: Path) -> None:
    runs = example_sweep(tmp_path / "runs", seeds=1)
    for name in ("one", "two"):
        write_reports(runs, tmp_path / name, None, draws=100, seed=3)
    for path in (tmp_path / "one").rglob("*.*"):
        assert path.read_bytes() == (tmp_path / "two" / path.relative_to(tmp_path / "one")).read_bytes(), path


def test_groups_have_labels_of_their_own_and_dollars_are_no_formulas(tmp_path: Path) -> None:
    for number, floor in enumerate((r"$\x$", "0.1")):
        overrides = (f"extent.floor={floor}",)
        example_run(tmp_path / "runs" / floor[:2], example_sums(0.7, number), overrides=overrides, extent="shrink_wrap")
    example_run(tmp_path / "runs" / "other", example_sums(0.7, 1, sequences=("07",)))
    write_reports(tmp_path / "runs", tmp_path / "out", None, draws=100, seed=1)
    labels = re.findall(r"\\label\{(.*)\}", (tmp_path / "out" / "report.tex").read_text())
    assert {"tab:table1", "tab:2_table1"} <= set(labels)
    assert len(labels) == len(set(labels))


def test_a_baseline_that_is_no_row_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    runs = example_run(tmp_path / "runs", example_sums(0.7, 1))
    with pytest.raises(ConfigError, match="baseline: expected one of track_max, nearest, found trackmax"):
        write_reports(runs, tmp_path / "out", "trackmax", draws=100, seed=1)
    assert not (tmp_path / "out").exists()


def test_letters_that_layouts_need_themselves_are_escaped(analysis: Analysis) -> None:
    table = Table("t", "50 % & a_b", ("c|d",), (), ("x < y",))
    assert r"50 \% \& a\_b" in latex(table)
    assert r"c\|d" in markdown(table)


def test_a_bin_without_instances_leaves_a_gap_in_its_curve_alone(tmp_path: Path) -> None:
    sums = example_sums(0.7, 1)
    for sequence in sums["sequences"].values():
        for rows in sequence["distance"].values():
            rows[-1] = [0] * 20
    example_run(tmp_path, sums)
    (found,) = group(find_runs(tmp_path).scored)
    parts = {"table1": amodalization(found), "table2": memberships(found)}
    drawn = {plot.name: plot.svg for plot in plots(parts, Analysis(found, 200, 1))}
    assert set(drawn) == {"extents", "visible", "distance", "points", "membership"}
    marks = {name: drawn[name].count("<use ") for name in ("distance", "points")}
    assert marks["points"] - marks["distance"] == 3  # seven bins and seven ticks, five bins and six ticks
