"""What a run keeps, and takes up again."""

from pathlib import Path

import lightning as L
import pytest
import torch
from lightning.pytorch.callbacks import ModelCheckpoint
from torch import Tensor, nn

from most.stages.checkpoints import BestCheckpoint


class Scripted(L.LightningModule):
    """A module that learns nothing, and reaches in each epoch the figure that it is told."""

    def __init__(self, figures: list[float]) -> None:
        super().__init__()
        self.figures = figures
        self.weight = nn.Parameter(torch.zeros(1))

    def training_step(self, batch: Tensor, _: int) -> Tensor:
        return self.weight.sum()

    def validation_step(self, batch: Tensor, _: int) -> None:
        self.log("val/pq", self.figures[self.current_epoch])

    def configure_optimizers(self) -> torch.optim.Optimizer:
        return torch.optim.SGD(self.parameters(), lr=0.1)


def train(folder: Path, figures: list[float], best: ModelCheckpoint, resume: bool = False) -> None:
    """Train an epoch for each figure; the last state is left in ``last.ckpt``."""
    trainer = L.Trainer(
        accelerator="cpu", max_epochs=len(figures), callbacks=[best], logger=False, default_root_dir=folder,
        enable_progress_bar=False, enable_model_summary=False, num_sanity_val_steps=0,
    )  # fmt: skip
    last = folder / "last.ckpt"
    trainer.fit(Scripted(figures), [torch.zeros(1)], [torch.zeros(1)], ckpt_path=last if resume else None)
    trainer.save_checkpoint(last)


def own(folder: Path) -> BestCheckpoint:
    return BestCheckpoint(folder / "best.ckpt", "val/pq")


def lightnings(folder: Path) -> ModelCheckpoint:
    """As runs had it before there was a class of our own."""
    return ModelCheckpoint(folder, "best", monitor="val/pq", mode="max", enable_version_counter=False)


@pytest.mark.parametrize("began_with", [own, lightnings])
@pytest.mark.parametrize(("figure", "epoch"), [(0.1, 0), (0.95, 1)])
def test_the_best_stays_the_best_in_a_folder_that_was_moved(tmp_path, began_with, figure, epoch):
    began, moved = tmp_path / "began", tmp_path / "moved"
    train(began, [0.9], began_with(began))
    began.rename(moved)
    train(moved, [0.9, figure], own(moved), resume=True)
    assert sorted(path.name for path in moved.iterdir()) == ["best.ckpt", "last.ckpt"]
    assert torch.load(moved / "best.ckpt", weights_only=True)["epoch"] == epoch
    assert not began.exists()
