"""The command: writes the report and prints the table; a mistake leaves no report behind."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from most.evaluate import main

CAR_1, ROAD = 10 | 1 << 16, 40


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A tree with the labels of one scan, and its prediction, as a benchmark's entrant would have them."""
    files = {"data/sequences/03/labels": [CAR_1, CAR_1, ROAD], "mine/sequences/03/predictions": [CAR_1] * 3}
    for kind, labels in files.items():
        (tmp_path / kind).mkdir(parents=True)
        np.array(labels, dtype="<u4").tofile(tmp_path / kind / "000000.label")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def command(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> None:
    monkeypatch.setattr(sys, "argv", ["evaluate", "dataset.root=data", 'dataset.splits.val=["03"]', *arguments])
    main()


def test_the_report_and_the_table(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    command(monkeypatch, "predictions=mine", "out=scores/metrics.json")
    panoptic = json.loads((folder / "scores" / "metrics.json").read_text())["panoptic"]
    assert panoptic["per_class"]["car"] == pytest.approx(
        {"pq": 2 / 3, "sq": 2 / 3, "rq": 1, "iou": 2 / 3, "tp": 1, "fp": 0, "fn": 0}
    )
    assert panoptic["pq_stuff_present"] is None  # the one road point is too small a segment to count
    assert {"pq", "sq", "rq", "pq_dagger", "miou", "pq_things", "miou_stuff"} <= set(panoptic)
    assert panoptic["membership_accuracy"] is None
    printed = " ".join(capsys.readouterr().out.split())
    assert "car 66.7 66.7 100.0 66.7 1 0 0" in printed
    assert "LSTQ PAT S_assoc S_cls PTQ PQ - - -" in printed
    assert "LSTQ, S_assoc: none, since no thing of the truth has enough points in any scan to be followed" in printed
    assert sorted(path.name for path in folder.iterdir()) == ["data", "mine", "scores"]


def test_the_threshold_of_segments_can_be_set(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The one road point, predicted as a car, is a segment that counts."""
    command(monkeypatch, "predictions=mine", "out=metrics.json", "dataset.min_points=1")
    panoptic = json.loads((folder / "metrics.json").read_text())["panoptic"]
    assert (panoptic["pq_stuff_present"], panoptic["per_class"]["road"]["fn"]) == (0, 1)


def test_a_mistake_is_one_message_and_no_report(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    with pytest.raises(SystemExit) as stop:
        command(monkeypatch, "predictions=yours")
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert "yours/sequences/03/predictions/000000.label: expected a prediction" in error
    assert "Traceback" not in error
    assert not (folder / "metrics.json").exists()
