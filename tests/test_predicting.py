"""Writing predictions: what is read back, what is left to do, and what is never left behind."""

import pytest
import torch

from most.assembly import Trained
from most.datasets import semantickitti
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.datasets.window_stream import WindowStream
from most.errors import DataError
from most.inference import Prediction
from most.membership import Clustering, Nearest
from most.predicting import (
    claim_folder,
    describe_model,
    describe_split,
    predicted_by,
    unfinished,
    write_predictions,
)
from most.predictions import read_prediction, write_prediction
from most.streaming import PanopticTracker
from most.structures import Detections, Panoptic
from most.tracking import TrackerSettings
from semantickitti_tree import write_sequence
from tiny import CAR, PERSON, ROAD, TAXONOMY, tiny_predictor

ONE_CAR = Detections(
    torch.tensor([CAR]), torch.tensor([0.75]), torch.tensor([[1.0, 2.0, -0.5]]), torch.tensor([[2.0, 1.0, 0.7]]),
    torch.tensor([[0.5, -3.0]]),
)  # fmt: skip
PREDICTION = Prediction(
    Panoptic(torch.tensor([CAR, ROAD, CAR, PERSON]), torch.tensor([1, 0, 2, 65535])), ONE_CAR,
    torch.tensor([[2.9, 1.6, 1.2]]), torch.tensor([0, -1, -1, -1]),
)  # fmt: skip
NOTHING = Prediction(
    Panoptic(torch.zeros(0, dtype=torch.int64), torch.zeros(0, dtype=torch.int64)),
    ONE_CAR.select(torch.zeros(1, dtype=torch.bool)), torch.zeros(0, 3), torch.zeros(0, dtype=torch.int64),
)  # fmt: skip


@pytest.fixture
def reader(tmp_path):
    write_sequence(tmp_path / "tree", "08", range(3))
    return SemanticKITTI(tmp_path / "tree", Splits(val=["08"]))


def files(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def write_all(reader, frames, out):
    model = PanopticTracker(Trained(tiny_predictor(), TAXONOMY, 1))
    write_predictions(model, WindowStream(reader, frames, previous=1), reader, out, len(frames))


@pytest.mark.parametrize("prediction", [PREDICTION, NOTHING])
def test_what_is_written_is_read_back(reader, tmp_path, prediction):
    path = tmp_path / "sequences" / "08" / "predictions" / "000000.label"
    write_prediction(prediction, reader, path)
    again = read_prediction(reader, path)
    for part in ("panoptic", "detections"):
        for name, value in vars(getattr(prediction, part)).items():
            read = getattr(getattr(again, part), name)
            assert (read is None) == (value is None)
            assert read is None or torch.equal(read, value), name
    assert torch.equal(again.roi, prediction.roi)
    assert torch.equal(again.claimed, prediction.claimed)


def test_a_prediction_that_is_not_there_is_named(reader, tmp_path):
    with pytest.raises(DataError, match=r"000000\.label: expected a label file, found none"):
        read_prediction(reader, tmp_path / "000000.label")


def test_every_sweep_gets_labels_and_detections(reader, tmp_path):
    out, frames = tmp_path / "out", reader.frames("val")
    write_all(reader, frames, out)
    names = [f"sequences/08/{kind}" for kind in ("detections/{}.npz", "predictions/{}.label")]
    assert files(out) == [name.format(f"{index:06d}") for name in names for index in range(3)]
    for frame in frames:
        found = read_prediction(reader, reader.prediction_path(out, frame)).panoptic
        assert len(found.semantics) == len(reader.labels(frame))
        assert (found.semantics > 0).all()


def test_only_what_is_missing_is_left_to_do(reader, tmp_path):
    out, frames = tmp_path / "out", reader.frames("val")
    assert unfinished(reader, frames, out) == frames
    write_all(reader, frames, out)
    assert unfinished(reader, frames, out) == []
    before = {path: (out / path).read_bytes() for path in files(out)}
    reader.prediction_path(out, frames[1]).unlink()
    assert unfinished(reader, frames, out) == frames  # tracks need all of a sequence
    write_all(reader, frames, out)
    assert {path: (out / path).read_bytes() for path in files(out)} == before


def test_labels_are_written_last_so_that_half_a_prediction_is_none(reader, tmp_path, monkeypatch):
    out, frames = tmp_path / "out", reader.frames("val")

    def full(*_):
        raise OSError("no space left on device")

    with monkeypatch.context() as broken:
        broken.setattr(semantickitti, "write_labels", full)
        with pytest.raises(OSError, match="no space"):
            write_all(reader, frames, out)
    assert files(out) == ["sequences/08/detections/000000.npz"]
    assert unfinished(reader, frames, out) == frames
    with monkeypatch.context() as broken:
        broken.setattr("most.files.os.fsync", full)  # within a write: the file is there, but not whole
        with pytest.raises(OSError, match="no space"):
            write_prediction(PREDICTION, reader, reader.prediction_path(out, frames[1]))
    assert files(out) == ["sequences/08/detections/000000.npz"]


@pytest.fixture
def checkpoint(tmp_path):
    path = tmp_path / "last.ckpt"
    path.write_bytes(b"weights")
    return path


def claim(out, checkpoint, reader, split, membership=None, tracker="greedy"):
    model = describe_model(checkpoint, membership, TrackerSettings(assignment=tracker))
    claim_folder(out, model, describe_split(reader, split))


def test_the_same_prediction_goes_on_in_its_folder(tmp_path, checkpoint, reader):
    out = tmp_path / "deep" / "out"
    for _ in range(2):
        claim(out, checkpoint, reader, "val")
    assert files(out) == ["prediction.json"]
    moved = checkpoint.rename(tmp_path / "renamed.ckpt")  # it is the content that counts
    claim(out, moved, SemanticKITTI(reader.root, reader.splits), "val")


def test_another_checkpoint_split_or_dataset_is_refused(tmp_path, checkpoint, reader):
    out = tmp_path / "out"
    claim(out, checkpoint, reader, "val")
    write_sequence(tmp_path / "elsewhere", "08", range(1))
    others = {
        "split": (SemanticKITTI(reader.root, Splits(val=["08"], test=["08"])), "test"),
        "tree": (SemanticKITTI(tmp_path / "elsewhere", reader.splits), "val"),
    }
    for other in others.values():
        with pytest.raises(
            DataError, match=r"tracker or of other scans \(.* another (split|dataset)\); choose another out"
        ):
            claim(out, checkpoint, *other)
    with pytest.raises(DataError, match="holds predictions of another checkpoint, membership"):
        claim(out, checkpoint, reader, "val", membership=Nearest())
    with pytest.raises(DataError, match=r"of other scans \(prediction\.json has another tracker\); choose another out"):
        claim(out, checkpoint, reader, "val", tracker="hungarian")
    checkpoint.write_bytes(b"other weights")
    with pytest.raises(DataError, match="holds predictions of another checkpoint"):
        claim(out, checkpoint, reader, "val")


def test_a_folder_with_other_files_is_refused_untouched(tmp_path, checkpoint, reader):
    out = tmp_path / "out"
    out.mkdir()
    claim(out, checkpoint, reader, "val")  # an empty one will do
    (out / "prediction.json").rename(out / "thesis.txt")
    with pytest.raises(DataError, match="expected a new or empty folder, found other files; choose another out"):
        claim(out, checkpoint, reader, "val")
    assert files(out) == ["thesis.txt"]


def test_what_a_killed_writer_left_is_no_other_content(tmp_path, checkpoint, reader):
    out = tmp_path / "out"
    out.mkdir()
    (out / ".prediction.json.x1y2.part").write_text("{")
    claim(out, checkpoint, reader, "val")
    assert "prediction.json" in files(out)


def test_a_folder_tells_what_is_no_default_of_how_it_was_predicted(tmp_path, checkpoint, reader):
    tracker = TrackerSettings(motion="kalman")
    for name, membership in {"trained": None, "nearest": Nearest(), "wide": Clustering(margin=2.0)}.items():
        described = describe_model(checkpoint, membership, tracker if name == "wide" else TrackerSettings())
        claim_folder(tmp_path / name, described, describe_split(reader, "val"))
    said = {name: predicted_by(tmp_path / name)["prediction"] for name in ("trained", "nearest", "wide")}
    assert {name: (each["membership"], each["changed"]) for name, each in said.items()} == {
        "trained": ("trained", []),
        "nearest": ("nearest", []),
        "wide": ("clustering", ["membership.margin=2.0", "tracker.motion=kalman"]),
    }
    assert len({each["checkpoint_sha256"] for each in said.values()}) == 1


@pytest.mark.parametrize("content", [None, "", "[]", "{}", '{"membership": 3, "tracker": {}}'])
def test_a_folder_that_does_not_tell_says_nothing(tmp_path, content):
    if content is not None:
        (tmp_path / "prediction.json").write_text(content)
    assert predicted_by(tmp_path) == {}


def test_a_file_in_the_folders_place_is_refused(checkpoint, reader):
    with pytest.raises(DataError, match=r"last\.ckpt: expected a new or empty folder, found a file; choose another"):
        claim(checkpoint, checkpoint, reader, "val")


@pytest.mark.parametrize("content", [b"", b"[]", b"{", b"\xff"])
def test_a_record_of_another_program_is_refused(tmp_path, checkpoint, reader, content):
    out = tmp_path / "out"
    out.mkdir()
    (out / "prediction.json").write_bytes(content)
    with pytest.raises(DataError, match=r"prediction\.json (is no note of most|has another .*)\); choose another out"):
        claim(out, checkpoint, reader, "val")
