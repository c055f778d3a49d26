"""What both stages do alike: they predict, publish the figures of a validation, and describe themselves."""

from typing import Any

import lightning as L

from most.datasets.taxonomy import Taxonomy
from most.inference import Prediction, Predictor
from most.structures import Sample


class Stage(L.LightningModule):
    """A part of the training; subclasses hold the networks of ``predictor`` as modules of the same names."""

    name: str
    prefix: str  # of the names under which losses and figures are logged

    def __init__(self, predictor: Predictor, taxonomy: Taxonomy, description: dict[str, Any], epochs: int) -> None:
        """``description`` goes into the checkpoints: plain types that say how to make the networks again."""
        super().__init__()
        self.predictor = predictor
        self.taxonomy = taxonomy
        self.description = description
        self.epochs = epochs  # of its whole training
        self.report: dict[str, Any] = {}  # the last validation's figures

    def publish(self, **figures: dict[str, Any]) -> None:
        """Keep the figures of a validation, fractions in [0, 1], and log those of the whole split.

        ``panoptic`` is logged as ``val/NAME``, any ``panoptic_WAY`` as ``val/WAY_NAME``.
        """
        epochs = self.current_epoch + int(self.trainer.state.fn == "fit")  # the running one is not counted yet
        self.report = {"epochs": epochs, **figures}
        for section, values in figures.items():
            way = section.removeprefix("panoptic").removeprefix("_")
            before = f"{self.prefix}val/{way}_" if way else f"{self.prefix}val/"
            self.log_dict({before + name: value for name, value in values.items() if isinstance(value, float)})

    def predict_step(self, samples: list[Sample], _: int) -> list[Prediction]:
        """Label every point of a batch's current sweeps."""
        return self.predictor(samples)

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Add what it takes to make the networks again."""
        checkpoint.update(self.description)
