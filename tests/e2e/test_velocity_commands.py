"""The commands of `make velocity`, from simulated traffic to the table, at a size for a test."""

import json
from pathlib import Path

from commands import TINY, most

TREE = ["dataset=traffic", "dataset.root=traffic", "dataset.tables=tables", "dataset.workers=0",
        "dataset.splits.train=[scene-0001]", "dataset.splits.val=[scene-0002]",
        "dataset.splits.test=[scene-0003,scene-0012]"]  # fmt: skip


def test_from_traffic_to_the_table(tmp_path: Path) -> None:
    simulated = "simulation.sequences=[scene-0001,scene-0002,scene-0003,scene-0012]"
    commands = [
        ["simulate", "simulation=traffic", "out=traffic", simulated, "simulation.scans=11"],
        ["train", "+experiment=sim_velocity", *TREE, *TINY, "logger=none", "hydra.run.dir=run"],
        ["predict", "checkpoint=run/checkpoints/detection-last.ckpt", "split=test", "out=predictions", *TREE],
        ["track", "predictions=predictions", "split=test", "out=velocity", *TREE],
        ["track", "predictions=predictions", "split=test", "out=nearest", "tracker.motion=nearest", *TREE],
        ["velocity", "velocity=velocity", "nearest=nearest", "split=test", *TREE],
    ]
    for command, *arguments in commands:
        done = most(tmp_path, command, *arguments)
        assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "velocity.json").read_text())
    assert (report["scans"], len(report["sequences"])) == (4, 2)
    assert 0 <= report["lstq"]["nearest"] <= 1
    assert "2 sequences, 4 scans" in done.stdout
