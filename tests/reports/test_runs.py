"""Runs are found at any depth and told apart by their configuration; what cannot be counted is named."""

import json
import re
from pathlib import Path

import pytest

from example_runs import example_run, example_sums, example_sweep
from most.errors import DataError
from most.keys import NO_FIGURE
from most.reports.groups import group
from most.reports.runs import find_runs


def ways(folder: Path) -> list[tuple[str, str, int, str]]:
    found = find_runs(folder).scored
    return [(each.strategy.detection, each.strategy.membership, each.seed, each.source) for each in found]


def test_a_run_of_both_stages_is_scored_twice(tmp_path: Path) -> None:
    example_run(tmp_path / "a/b/c", example_sums(0.7, 1), seed=4, nearest=example_sums(0.6, 1))
    assert ways(tmp_path) == [("track_max", "full", 4, "validated"), ("track_max", "nearest", 4, "beside")]


def test_stage_1_alone_is_scored_by_what_needs_no_training(tmp_path: Path) -> None:
    sums = example_sums(0.7, 1)
    example_run(tmp_path / "1", sums, membership="full")
    example_run(tmp_path / "2", sums, membership="clustering")
    example_run(tmp_path / "3", sums, backbone={"separate": True}, extent="shrink_wrap")
    example_run(tmp_path / "4", sums, heads="offset_regression")
    example_run(tmp_path / "5", sums, heads="offset_regression", extent="amodal")
    assert [way[:2] for way in ways(tmp_path)] == [
        ("track_max", "nearest"), ("track_max", "clustering"), ("shrink_wrap+separate", "nearest"),
        ("offset_regression", "mean_shift"), ("offset_regression+amodal", "mean_shift"),
    ]  # fmt: skip


def test_changed_settings_make_another_strategy_where_not_all_runs_have_them(tmp_path: Path) -> None:
    changed = ("extent=track_max", "extent.floor=0.1", "heads.centre.channels=8", "membership.widths=[4]")
    example_run(tmp_path / "a", example_sums(0.7, 1), overrides=changed, nearest=example_sums(0.6, 1))
    (alone,) = group(find_runs(tmp_path).scored)
    assert [each.title for each in alone.strategies] == ["Modal Det. (MAX)"] * 2
    assert alone.settings == ["track_max (floor=0.1)", "modal_centres (centre.channels=8)", "full (widths=[4])"]
    example_run(tmp_path / "b", example_sums(0.7, 1), nearest=example_sums(0.6, 1), overrides=changed[2:])
    (both,) = group(find_runs(tmp_path).scored)
    assert {each.title for each in both.strategies} == {"Modal Det. (MAX)", "Modal Det. (MAX) (floor=0.1)"}
    assert both.settings == ["modal_centres (centre.channels=8)", "full (widths=[4])"]


def test_what_most_evaluate_said_counts_under_the_name_of_its_file(tmp_path: Path) -> None:
    run = example_run(tmp_path / "run", example_sums(0.7, 1), nearest=example_sums(0.6, 1))
    (run / "evaluated").mkdir()
    for name in ("full", "clustering"):
        report = {"scans": 40, "panoptic": {"sums": example_sums(0.8, 2, tracked=True)}}
        (run / "evaluated" / f"{name}.json").write_text(json.dumps(report))
    (found,) = group(find_runs(tmp_path).scored)
    assert [each.membership for each in found.strategies] == ["nearest", "clustering", "full"]
    full = found.by_seed(found.strategies[-1])[1]
    assert full.source == "evaluated"
    assert full.sums.tracks is not None


def test_unfinished_runs_and_those_without_sums_are_left_out_with_a_reason(tmp_path: Path) -> None:
    example_run(tmp_path / "done", example_sums(0.7, 1))
    halted = example_run(tmp_path / "halted", None)
    (halted / "checkpoints").mkdir()
    (halted / "checkpoints" / "detection-last.ckpt").touch()
    half = example_run(tmp_path / "half", example_sums(0.7, 1), stage={"run": ["detection", "membership"]})
    old = example_run(tmp_path / "old", None)
    (old / "metrics.json").write_text('{"epochs": 2, "panoptic": {"pq": 0.5}}')
    runs = find_runs(tmp_path)
    assert [each.folder for each in runs.scored] == [tmp_path / "done"]
    assert "resume=" in runs.left_out[halted]
    assert "stage 2 has not ended" in runs.left_out[half]
    assert "earlier version" in runs.left_out[old / "metrics.json"]
    assert len(runs.left_out) == 3


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        (".hydra/config.yaml", "{", r"config\.yaml: expected what Hydra wrote"),
        (".hydra/config.yaml", "{stage: {run: [detection]}}", r"config\.yaml: expected a configuration of most.train"),
        (".hydra/hydra.yaml", "{}", r"hydra\.yaml: expected hydra.runtime.choices"),
        (".hydra/hydra.yaml", "hydra: x", r"hydra\.yaml: expected hydra.runtime.choices"),
        (".hydra/overrides.yaml", "!!python/object/apply:os.getcwd []", r"overrides\.yaml: expected what Hydra wrote"),
        ("metrics.json", "[]", r"metrics\.json: expected a report"),
        ("metrics.json", '{"panoptic": {"sums": {"classes": 3}}}', r"metrics\.json: expected the sums of held-out"),
    ],
)
def test_a_damaged_run_is_left_out_by_name(tmp_path: Path, name: str, content: str, message: str) -> None:
    whole, damaged = (example_run(tmp_path / each, example_sums(0.7, 1)) for each in ("whole", "damaged"))
    (damaged / name).write_text(content)
    found = find_runs(tmp_path)
    assert [run.folder for run in found.scored] == [whole]
    assert re.search(message, found.left_out[damaged])


def test_nothing_of_a_damaged_run_is_counted(tmp_path: Path) -> None:
    run = example_run(tmp_path, example_sums(0.7, 1))
    evaluated(run, "clustering", membership="clustering", changed=None)
    assert len(find_runs(tmp_path).scored) == 2
    (run / "metrics.json").write_text("[]")
    found = find_runs(tmp_path)
    assert not found.scored
    assert list(found.left_out) == [run]


@pytest.mark.parametrize("change", [("tp", [1]), ("iou", [-1.0] * 20), ("membership", [1, 2]), ("scans", None)])
def test_sums_of_another_shape_or_below_0_are_refused(tmp_path: Path, change: tuple[str, object]) -> None:
    sums = example_sums(0.7, 1)
    sums["sequences"]["09"][change[0]] = change[1]
    example_run(tmp_path, sums)
    found = find_runs(tmp_path)
    assert not found.scored
    assert "metrics.json: expected the sums" in found.left_out[tmp_path]


def test_a_folder_without_runs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="expected runs of most"):
        find_runs(tmp_path)
    with pytest.raises(DataError, match="found no folder"):
        find_runs(tmp_path / "nowhere")


def test_strategies_and_seeds_of_one_experiment_are_one_group(tmp_path: Path) -> None:
    (found,) = group(find_runs(example_sweep(tmp_path)).scored)
    assert [each.detection for each in found.strategies if each.membership == "full"] == [
        "shrink_wrap", "drop_small", "class_mean", "track_max", "amodal",
    ]  # fmt: skip
    assert all(sorted(found.by_seed(each)) == [1, 2, 3] for each in found.strategies)


def test_other_sequences_or_settings_are_groups_of_their_own_that_say_what_tells_them_apart(tmp_path: Path) -> None:
    for number, extent in enumerate(("track_max", "shrink_wrap")):
        example_run(tmp_path / "main" / str(number), example_sums(0.7, 1), extent=extent)
    example_run(tmp_path / "sequences", example_sums(0.7, 1, sequences=("07",)))
    example_run(tmp_path / "settings", example_sums(0.7, 1), backbone={"widths": [8, 8]})
    example_run(tmp_path / "validated", example_sums(0.7, 1), trainer={"validate_every": 1})
    example_run(tmp_path / "precision", example_sums(0.7, 1), trainer={"precision": "16-mixed"})
    other_scans = example_sums(0.7, 1)
    other_scans["sequences"]["09"]["true"][1] += 1
    example_run(tmp_path / "scans", other_scans)
    first, *others = group(find_runs(tmp_path).scored)
    assert len(first.rows) == 2
    assert "backbone.widths=[4, 8]" in first.title
    assert {len(each.rows) for each in others} == {1}
    assert sorted("1 sequence (07)" in each.title for each in others) == [False] * 4 + [True]
    assert sum("trainer.precision=16-mixed" in each.title for each in others) == 1


def test_two_runs_that_differ_in_an_extent_that_nothing_uses_are_one(tmp_path: Path) -> None:
    for extent in ("track_max", "shrink_wrap"):
        example_run(tmp_path / extent, example_sums(0.7, 1), heads="offset_regression", extent=extent)
    with pytest.raises(DataError, match=r"one run of offset_regression \(offset_regression uses no extent\), .*seed 1"):
        group(find_runs(tmp_path).scored)


def evaluated(run: Path, name: str, **prediction: object) -> None:
    report = {"scans": 40, "panoptic": {"sums": example_sums(0.8, 2, tracked=True)}}
    (run / "evaluated").mkdir(exist_ok=True)
    (run / "evaluated" / f"{name}.json").write_text(
        json.dumps(report | ({"prediction": prediction} if prediction else {}))
    )


def test_what_predictions_say_of_themselves_counts_more_than_the_name_of_a_file(tmp_path: Path) -> None:
    run = example_run(tmp_path / "run", example_sums(0.7, 1), nearest=example_sums(0.6, 1))
    evaluated(run, "wide", membership="clustering", changed=["membership.margin=2.0", "tracker.motion=nearest"])
    evaluated(run, "clustering")
    evaluated(run, "again", membership="trained", changed=[])
    found = {each.strategy.membership: each for each in find_runs(tmp_path).scored if each.source == "evaluated"}
    assert set(found) == {"clustering (margin=2.0)", "clustering", "full"}
    assert found["clustering (margin=2.0)"].told == ("membership.margin=2.0", "tracker.motion=nearest")
    assert found["full"].told == ()
    assert found["clustering"].told is None


def test_stage_1_is_told_by_where_it_was_trained(tmp_path: Path) -> None:
    """Of itself, or of another's folder or checkpoint, from wherever that was named; copies keep what was."""
    sums, beside = example_sums(0.7, 1), example_sums(0.6, 1)
    example_run(tmp_path / "one", sums)
    best = "./one/checkpoints/detection-best.ckpt"
    places = ("one", best, "/trained/one", "/elsewhere/weights.ckpt", "seed-${seed}", "${nothing}")
    for number, place in enumerate(places):
        example_run(tmp_path / f"{number}", sums, seed=number, nearest=beside, stage1=place)
    found = {each.folder.name: each.stage1 for each in find_runs(tmp_path).scored}
    assert found == {
        **dict.fromkeys(("one", "0", "1", "2"), "/trained/one"),
        "3": "/elsewhere/weights.ckpt",
        "4": "/trained/seed-4",
        "5": "/trained/${nothing}",
    }


def test_what_changes_no_figure_for_a_sweep_changes_none_for_a_report(tmp_path: Path) -> None:
    for number in (1, 2):
        settings = {"name": f"try{number}", "trainer": {"threads": number}, "logger": {"kind": "none", "mode": number}}
        example_run(tmp_path / str(number), example_sums(0.7, number), seed=number, **settings)
    (found,) = group(find_runs(tmp_path).scored)
    assert found.title.startswith("sim_demo on simulated")
    assert sorted(found.by_seed(found.strategies[0])) == [1, 2]
    assert {"name", "logger", "trainer.threads"} <= {*NO_FIGURE}


def test_two_runs_of_one_strategy_and_seed_are_refused(tmp_path: Path) -> None:
    for name in ("one", "two"):
        example_run(tmp_path / name, example_sums(0.7, 1))
    with pytest.raises(DataError, match=r"two: expected one run of track_max.*found another in .*one; keep one"):
        group(find_runs(tmp_path).scored)


def test_of_two_scores_of_one_seed_the_tables_take_theirs_and_no_seed_is_lost(tmp_path: Path) -> None:
    for seed in (1, 2):
        example_run(tmp_path / f"stage1,{seed}", example_sums(0.7, seed), seed=seed)
    example_run(tmp_path / "both,1", example_sums(0.7, 1), nearest=example_sums(0.6, 3))
    (found,) = group(find_runs(tmp_path).scored)
    nearest = found.strategies[0]
    assert {seed: run.source for seed, run in found.by_seed(nearest).items()} == {1: "validated", 2: "validated"}
    beside = found.by_seed(nearest, beside=True)
    assert {seed: run.source for seed, run in beside.items()} == {1: "beside", 2: "validated"}
