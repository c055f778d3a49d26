"""Two real trainings, told apart by their seeds, and a report on them from their folders alone."""

import csv
import json
from pathlib import Path

import pytest

from commands import SIMULATE, TRAIN, most


def test_from_two_trainings_to_the_report(tmp_path: Path) -> None:
    arguments = [*TRAIN, "logger=none", "logger.pictures=0"]
    commands = [["simulate", *SIMULATE]]
    commands += [["train", *arguments, f"seed={seed}", f"hydra.run.dir=runs/{seed}"] for seed in (1, 2)]
    commands += [["report", "runs=runs", "out=report", "draws=200"]]
    for command, *told in commands:
        done = most(tmp_path, command, *told)
        assert done.returncode == 0, done.stderr
    assert "report/report.html" in done.stdout
    trained = [json.loads((tmp_path / "runs" / str(seed) / "metrics.json").read_text()) for seed in (1, 2)]
    with (tmp_path / "report/tables/table2.csv").open() as file:
        rows = {row["row"]: row for row in csv.DictReader(file) if row["from"] == "ours"}
    for title, section in {
        "Nearest neighbour (baseline)": "panoptic_nearest",
        "+ Point feat. (full)": "panoptic",
    }.items():
        for column, key in {"PQ": "pq", "mIoU": "miou", "PQ present": "pq_present"}.items():
            mean = sum(report[section][key] for report in trained) / 2
            assert float(rows[title][column]) == pytest.approx(mean), (title, column)
        assert rows[title]["seeds"] == "1 2"
        assert float(rows[title]["PQ low"]) <= float(rows[title]["PQ"]) <= float(rows[title]["PQ high"])

    assert "full (widths=[4,4])." in (tmp_path / "report/report.md").read_text()

    refused = most(tmp_path, "report", "runs=runs", "out=other", "baseline=trackmax")
    assert refused.returncode == 2
    assert "baseline: expected one of track_max, nearest, full, found trackmax" in refused.stderr
    assert most(tmp_path, "report", "runs=report", "out=other").returncode == 2
    assert not (tmp_path / "other").exists()
