"""Two real processes, as Lightning starts them, train and validate as one does that takes both their batches."""

import json
from pathlib import Path

import torch

from commands import SIMULATE, TRAIN, most, most_anew

TWO = ["trainer=ddp", "trainer.accelerator=cpu", "trainer.devices=2", "logger=none", "logger.pictures=0"]


def test_two_processes_train_both_stages_and_count_every_sweep_once(tmp_path: Path) -> None:
    assert most(tmp_path, "simulate", *SIMULATE, "simulation.scans=4").returncode == 0
    arguments = [*TRAIN, "trainer.validate_every=1", "trainer.precision=32-true"]
    one = ["dataset.batch_size=2", "logger=none", "logger.pictures=0"]
    for run, command, extra in (("two", most_anew, TWO), ("one", most, one)):
        done = command(tmp_path, "train", *arguments, *extra, f"hydra.run.dir={run}")
        assert done.returncode == 0, done.stderr
    one, two = (json.loads((tmp_path / run / "metrics.json").read_text())["panoptic"] for run in ("one", "two"))
    for name, figures in one["per_class"].items():  # a sweep counted twice would show
        assert two["per_class"][name]["tp"] + two["per_class"][name]["fn"] == figures["tp"] + figures["fn"], name
    first, second = (
        torch.load(tmp_path / run / "checkpoints/detection-last.ckpt", weights_only=True)["state_dict"]
        for run in ("one", "two")
    )
    assert first.keys() == second.keys()
    apart = torch.cat([(second[name] - value).flatten().double().abs() for name, value in first.items()])
    # AdamW moves a weight whose gradient is rounding alone as far as any: single ones may differ by 0.002. Where each
    # process has batch statistics of its own, the mean is 0.004.
    assert apart.mean() < 1e-4
