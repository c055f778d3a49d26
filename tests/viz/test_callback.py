"""Pictures of a validation: which sweeps, where they go, and what counts as the truth."""

from types import SimpleNamespace

import lightning as L
import pytest
from matplotlib.figure import Figure

from most.viz import callback
from most.viz.callback import BevPictures, draw_prediction
from tiny import TAXONOMY, cloud, street, tiny_predictor, window


class Validating(L.Trainer):
    """A trainer in the midst of a validation of ``batches``."""

    num_val_batches, is_global_zero, current_epoch, logger = (), True, 7, None

    def __init__(self, batches, zero):
        self.num_val_batches, self.is_global_zero = [batches], zero


def drawn(number, batches, folder, monkeypatch, zero=True):
    """The batches of which a picture is made."""
    monkeypatch.setattr(callback, "draw_prediction", lambda *_: Figure(figsize=(1, 1)))
    trainer, stage = Validating(batches, zero), SimpleNamespace(taxonomy=TAXONOMY)
    sample = window(cloud(3))
    outputs = {"predictions": tiny_predictor()([sample])}
    for index in range(batches):
        sample.index = index
        BevPictures(number, folder).on_validation_batch_end(trainer, stage, outputs, [sample], index)
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.png"))


@pytest.mark.parametrize(
    ("number", "batches", "indices"),
    [(0, 5, []), (1, 5, [2]), (2, 8, [2, 6]), (3, 3, [0, 1, 2]), (9, 2, [0, 1]), (2, 0, [])],
)
def test_pictures_are_evenly_spread(tmp_path, monkeypatch, number, batches, indices):
    expected = [f"epoch_007/00_{index:06d}.png" for index in indices]
    assert drawn(number, batches, tmp_path, monkeypatch) == expected


def test_one_process_draws(tmp_path, monkeypatch):
    assert drawn(2, 4, tmp_path, monkeypatch, zero=False) == []


@pytest.mark.parametrize(("sample", "panels"), [(street(), 3), (window(cloud(30)), 1)])
def test_a_prediction_is_drawn_beside_its_truth_where_there_is_one(sample, panels):
    predictor = tiny_predictor()
    predictor.network.eval()
    (prediction,) = predictor([sample])
    assert len(draw_prediction(sample, prediction, TAXONOMY).axes) == panels


def test_things_without_an_instance_are_none_in_the_truth(monkeypatch):
    sample, seen = street(), []
    sample.labels[:40] &= 0xFFFF  # the first car is annotated as car, but as no instance
    monkeypatch.setattr(callback, "draw_bev", lambda _, truth, *rest, **named: seen.append(truth) or Figure())
    predictor = tiny_predictor()
    draw_prediction(sample, predictor([sample])[0], TAXONOMY)
    assert (seen[0].ids[:40] == 0).all()
    assert (seen[0].ids[40:80] == sample.labels[40]).all()
    assert (seen[0].ids[80:] == 0).all()
