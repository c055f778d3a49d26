"""The commands of `make velocity`, from simulated traffic to the table, at a size for a test."""

import json
from pathlib import Path

import pytest

from commands import TINY, most


@pytest.mark.parametrize(
    ("traffic", "names", "key_frames"),
    [
        ("traffic", ["scene-0001", "scene-0002", "scene-0003", "scene-0012"], 2),
        ("traffic_10hz", ["00", "01", "02", "03"], 3),
    ],
)
def test_from_traffic_to_the_table(tmp_path: Path, traffic: str, names: list[str], key_frames: int) -> None:
    train, val, *test = (f"'{name}'" for name in names)
    tree = [f"dataset={traffic}", "dataset.root=scans", "dataset.tables=tables", "dataset.workers=0",
            f"dataset.splits.train=[{train}]", f"dataset.splits.val=[{val}]",
            f"dataset.splits.test=[{','.join(test)}]"]  # fmt: skip
    simulated = f"simulation.sequences=[{train},{val},{','.join(test)}]"
    commands = [
        ["simulate", f"simulation={traffic}", "out=scans", simulated, "simulation.scans=11"],
        ["train", "+experiment=sim_velocity", *tree, *TINY, "logger=none", "hydra.run.dir=run"],
        ["predict", "checkpoint=run/checkpoints/detection-last.ckpt", "split=test", "out=predictions", *tree],
        ["track", "predictions=predictions", "split=test", "out=velocity", *tree],
        ["track", "predictions=predictions", "split=test", "out=nearest", "tracker.motion=nearest", *tree],
        ["velocity", "velocity=velocity", "nearest=nearest", "split=test", *tree],
    ]
    for command, *arguments in commands:
        done = most(tmp_path, command, *arguments)
        assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "velocity.json").read_text())
    assert (report["scans"], len(report["sequences"])) == (2 * key_frames, 2)
    assert 0 <= report["lstq"]["nearest"] <= 1
    assert f"2 sequences, {2 * key_frames} scans" in done.stdout
