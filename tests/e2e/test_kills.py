"""Twenty kills at random moments: whatever was being written, the same command, run again, ends as if undisturbed."""

import random
import time
from collections.abc import Callable
from pathlib import Path

import torch

from commands import SIMULATE, TRAIN, Command

QUIET = ["logger=none", "logger.pictures=0", "trainer.progress_bar=false", "trainer.save_every=0.00001"]
PREDICT = ["checkpoint=model.ckpt", "split=val", "dataset=simulated", "dataset.root=streets", "dataset.workers=0",
           "dataset.splits.val=['00','01']"]  # fmt: skip


def calmly(folder: Path, command: str, *arguments: str) -> float:
    """Let a command end; return how long it took, s."""
    begin = time.monotonic()
    done = Command(folder, command, *arguments).done()
    assert done.returncode == 0, done.stderr
    return time.monotonic() - begin


def disturbed(
    folder: Path, kills: int, seconds: float, chance: random.Random, command: str, arguments: Callable[[], list[str]]
) -> int:
    """Kill a command ``kills`` times within ``seconds`` of its start, then let it end; return how often it lived."""
    lived = sum(
        not Command(folder, command, *arguments()).ends_within(chance.uniform(0.0, seconds)) for _ in range(kills)
    )
    calmly(folder, command, *arguments())
    return lived


def files(folder: Path) -> dict[str, bytes]:
    """Everything in a folder; not what killed writers left, which nobody reads."""
    whole = [path for path in folder.rglob("*") if path.is_file() and not path.name.endswith(".part")]
    return {str(path.relative_to(folder)): path.read_bytes() for path in whole}


def test_twenty_kills_leave_nothing_that_a_rerun_trips_over(tmp_path: Path) -> None:
    calm, rough, chance = tmp_path / "calm", tmp_path / "rough", random.Random(0)
    for folder in (calm, rough):
        folder.mkdir()

    seconds = calmly(calm, "simulate", *SIMULATE)
    lived = disturbed(rough, 5, 0.7 * seconds, chance, "simulate", lambda: SIMULATE)
    assert files(rough / "streets") == files(calm / "streets")

    def train() -> list[str]:
        """Go on from the newest checkpoint, where there is one."""
        kept = [rough / "run" / "checkpoints" / f"{stage}-last.ckpt" for stage in ("membership", "detection")]
        resume = [f"resume={path}" for path in kept if path.is_file()][:1]
        return [*TRAIN, *QUIET, "hydra.run.dir=run", *resume]

    seconds = calmly(calm, "train", *TRAIN, *QUIET, "hydra.run.dir=run")
    lived += disturbed(rough, 10, 0.7 * seconds, chance, "train", train)
    weights = [
        torch.load(folder / "run/checkpoints/membership-last.ckpt", weights_only=True) for folder in (calm, rough)
    ]
    for name, value in weights[0]["state_dict"].items():
        assert torch.equal(value, weights[1]["state_dict"][name]), name

    for folder in (calm, rough):
        (folder / "run/checkpoints/membership-last.ckpt").rename(folder / "model.ckpt")
    seconds = calmly(calm, "predict", *PREDICT, "out=out")
    lived += disturbed(rough, 5, 0.7 * seconds, chance, "predict", lambda: [*PREDICT, "out=out"])
    assert files(rough / "out" / "sequences").keys() == files(calm / "out" / "sequences").keys()
    labels = {name: data for name, data in files(calm / "out").items() if name.endswith(".label")}
    assert all(files(rough / "out")[name] == data for name, data in labels.items())
    assert lived >= 10  # most of the kills found something to kill
