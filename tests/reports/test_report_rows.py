"""Which runs make the rows of a table, which of two rows belong together, and which are independent trainings."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from example_runs import example_run, example_sums, ours
from most.reports.ablations import OWN_REGIONS, amodalization, memberships
from most.reports.analysis import Analysis
from most.reports.groups import group
from most.reports.notes import ALONE, ONE_SEQUENCE, SHARED, remarks
from most.reports.orders import order_table
from most.reports.plots import plots
from most.reports.runs import Scored, find_runs
from most.reports.table import seeds
from most.reports.tables import ablation_table, difference_table
from most.reports.units import units


def test_runs_without_a_seed_in_common_have_no_difference(tmp_path: Path) -> None:
    for seed, extent in ((1, "shrink_wrap"), (2, "track_max")):
        example_run(tmp_path / extent, example_sums(0.7, seed), seed=seed, extent=extent)
    (found,) = group(find_runs(tmp_path).scored)
    table = difference_table(amodalization(found), Analysis(found, 200, 1), None)
    assert ours(table) == {"Modal Det. (MAX)": {}}


def test_seeds_on_one_stage_1_are_no_independent_trainings(tmp_path: Path) -> None:
    """Three seeds of stage 2 on one stage 1, and three of both stages: means are those of the seeds all the same."""
    for seed in (1, 2, 3):
        for membership, settings in (("full", {}), ("geometric", {"stage1": "first"})):
            sums, beside = example_sums(0.4 + 0.1 * seed, seed, sequences=("09",)), example_sums(0.4, seed, ("09",))
            example_run(
                tmp_path / f"{membership}{seed}", sums, seed=seed, membership=membership, nearest=beside, **settings
            )
    (found,) = group(find_runs(tmp_path).scored)
    analysis, ways = Analysis(found, 200, 1), memberships(found)
    table = ablation_table(ways, analysis)
    rows = {row.title: row for block, row in table.rows() if block.ours}
    alone, shared = rows["+ Point feat. (full)"], rows["PointSegMLP (semantic + geometric)"]
    assert (seeds(alone), seeds(shared)) == ("1, 2, 3", "1, 2, 3 on one stage 1")
    assert alone.cells["PQ"].value == pytest.approx(shared.cells["PQ"].value)
    assert alone.cells["PQ"].low < alone.cells["PQ"].value < alone.cells["PQ"].high
    assert shared.cells["PQ"].low is None  # one training on one sequence
    said = [*remarks(found)]
    assert SHARED in said
    assert ALONE not in said
    assert ONE_SEQUENCE in said


def test_memberships_are_compared_on_the_same_stage_1(tmp_path: Path) -> None:
    """Those of seeds 1 and 2 both stand on the first one's, of which full has seed 1 alone."""
    for seed in (1, 2):
        for membership, settings in (("full", {}), ("geometric", {"stage1": "full1"})):
            example_run(
                tmp_path / f"{membership}{seed}", example_sums(0.3 * seed, seed), seed=seed, membership=membership,
                nearest=example_sums(0.3, seed), **settings,
            )  # fmt: skip
    (found,) = group(find_runs(tmp_path).scored)
    table = difference_table(memberships(found), Analysis(found, 200, 1), "full")
    rows = {row.title: row for row in table.blocks[0].rows}
    assert rows["PointSegMLP (semantic + geometric)"].parts == [[1]]
    assert rows["PointSegMLP (semantic + geometric)"].cells["PQ"].value == 0


def test_each_membership_is_compared_with_the_nearest_centres_on_its_own_stage_1(tmp_path: Path) -> None:
    """A sweep that trains both stages for each membership, none of which changes anything."""
    for membership, quality in (("full", 0.5), ("geometric", 0.9)):
        for seed in (1, 2):
            sums = example_sums(quality, seed)
            example_run(tmp_path / f"{membership}{seed}", sums, seed=seed, membership=membership, nearest=sums)
    (found,) = group(find_runs(tmp_path).scored)
    analysis, ways = Analysis(found, 200, 1), memberships(found)
    table = difference_table(ways, analysis, None)
    assert [(row.parts, row.cells["PQ"].value) for row in table.blocks[0].rows] == [([[1], [2]], 0)] * 2
    order = order_table({"table1": amodalization(found), "table2": ways}, analysis)
    assert order.words["geometric above nearest"].startswith("open")
    assert order.words["full above geometric"] == "no seed, or no stage 1, in common"


def test_offsets_are_shown_as_most_trainings_were_scored(tmp_path: Path) -> None:
    """One of three was scored in another way, too."""
    for seed in (1, 2, 3):
        run = example_run(tmp_path / f"{seed}", example_sums(0.7, seed), seed=seed, heads="offset_regression")
    wide = {"prediction": {"membership": "mean_shift", "changed": ["membership.bandwidth=5"]}}
    (run / "evaluated").mkdir()
    (run / "evaluated" / "wide.json").write_text(json.dumps({"panoptic": {"sums": example_sums(0.1, 1)}} | wide))
    (found,) = group(find_runs(tmp_path).scored)
    (row,) = amodalization(found).rows.values()
    assert row.membership == "mean_shift"


def test_table_2_stands_on_the_papers_stage_1_where_as_much_was_tried_on_others(tmp_path: Path) -> None:
    for extent in ("amodal", "shrink_wrap", "track_max"):
        example_run(tmp_path / extent, example_sums(0.7, 1), extent=extent, nearest=example_sums(0.6, 1))
    (found,) = group(find_runs(tmp_path).scored)
    assert "(SW), w/ sharing" in memberships(found).notes[0]


def test_the_accuracy_of_clusterings_is_of_other_points_and_left_out(tmp_path: Path) -> None:
    example_run(tmp_path, example_sums(0.7, 1), nearest=example_sums(0.6, 1))
    (tmp_path / "evaluated").mkdir()
    (tmp_path / "evaluated" / "clustering.json").write_text(json.dumps({"panoptic": {"sums": example_sums(0.8, 2)}}))
    (found,) = group(find_runs(tmp_path).scored)
    table = ablation_table(memberships(found), Analysis(found, 200, 1))
    assert "PQ" in ours(table)["Clustering (training-free)"]
    assert "Membership Acc" not in ours(table)["Clustering (training-free)"]
    assert "Membership Acc" in ours(table)["Nearest neighbour (baseline)"]
    assert OWN_REGIONS in table.notes


def test_rows_without_accuracy_are_not_in_its_plot_and_take_no_legend_from_others(tmp_path: Path) -> None:
    run = example_run(tmp_path, example_sums(0.7, 1), membership="geometric", stage={"run": ["detection"]})
    (run / "metrics.json").unlink()
    (run / "evaluated").mkdir()
    for name in ("clustering", "full"):
        (run / "evaluated" / f"{name}.json").write_text(json.dumps({"panoptic": {"sums": example_sums(0.8, 2)}}))
    (found,) = group(find_runs(tmp_path).scored)
    parts = {"table1": amodalization(found), "table2": memberships(found)}
    plot = next(each for each in plots(parts, Analysis(found, 200, 1)) if each.name == "membership")
    assert "Clustering" not in plot.meaning
    assert re.search(r"full\) \d+\.\d, \d+\.\d", plot.meaning)
    assert "contested" in plot.svg


def test_rows_of_one_training_are_named_where_others_have_more(tmp_path: Path) -> None:
    for seed, extent in ((1, "shrink_wrap"), (2, "shrink_wrap"), (1, "track_max")):
        example_run(tmp_path / f"{extent}{seed}", example_sums(0.7, seed), seed=seed, extent=extent)
    (found,) = group(find_runs(tmp_path).scored)
    assert [*remarks(found)] == [f"{ALONE} Modal Det. (MAX), nearest."]
    parts = {"table1": amodalization(found), "table2": memberships(found)}
    table = order_table(parts, Analysis(found, 200, 1))
    assert re.fullmatch(r"one training \([\d.]+ % of draws agree\)", table.words["MAX above SW"])
    assert table.title.endswith("Of 1: 0 shown, 0 reversed, 0 open, 1 not told")


def test_seeds_are_parted_by_what_any_row_says_of_them(tmp_path: Path) -> None:
    example_run(tmp_path, example_sums(0.7, 1))
    (one,) = find_runs(tmp_path).scored

    def row(*stages1: str, extent: str = "track_max") -> dict[int, Scored]:
        like = replace(one, strategy=replace(one.strategy, extent=extent))
        return {seed: replace(like, stage1=stage1) for seed, stage1 in enumerate(stages1, start=1)}

    assert units(row("a", "b", "c")) == [[1], [2], [3]]
    assert units(row("a", "b", "b", "d"), row("a", "a", "c", extent="amodal")) == [[1, 2, 3]]
    assert units(row("a", "b", "b", "d"), row("a", "b", "c", "d", extent="amodal")) == [[1], [2, 3], [4]]
    assert units(row("a", "b", "b", "d"), row("a", "b", "c", "d")) == [[1], [2], [4]]  # memberships on other stages 1
    assert units(row("a"), {}) == []
