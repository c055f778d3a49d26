"""Figures by class for W&B: curves, a table, and which class is taken for which."""

from typing import Any

import lightning as L
import wandb
from jaxtyping import Int64
from lightning.pytorch.callbacks import Callback
from lightning.pytorch.loggers import WandbLogger
from torch import Tensor
from wandb.plot import CustomChart, plot_table

from most.datasets.taxonomy import Taxonomy

COLUMNS = ("pq", "sq", "rq", "iou", "tp", "fp", "fn")


class ClassTables(Callback):
    """Logs ``val/class_pq/NAME`` of every class, ``val/per_class`` and ``val/confusion_matrix`` of each validation."""

    def __init__(self, prefix: str = "") -> None:
        self.prefix = prefix  # of all names

    def on_validation_end(self, trainer: L.Trainer, pl_module: Any) -> None:
        """Log what the stage found."""
        if not isinstance(trainer.logger, WandbLogger) or not trainer.is_global_zero:
            return
        rows, before = pl_module.report["panoptic"]["per_class"], f"{self.prefix}val/"
        curves = {f"{before}class_pq/{name}": row["pq"] for name, row in rows.items()}
        table = wandb.Table(["class", *COLUMNS], [[name, *(row[key] for key in COLUMNS)] for name, row in rows.items()])
        chart = confusion_chart(pl_module.scores.confusion, pl_module.taxonomy)
        media: dict[str, Any] = {f"{before}per_class": table, f"{before}confusion_matrix": chart}
        trainer.logger.log_metrics(curves | media, trainer.global_step)


def confusion_chart(confusion: Int64[Tensor, "classes classes"], taxonomy: Taxonomy) -> CustomChart:
    """Return points of each pair of classes as W&B's confusion matrix; points of void truth are left out.

    ``confusion`` is indexed [predicted, truth], void included.
    """
    names = taxonomy.class_names
    pairs = [
        [names[truth], names[predicted], int(confusion[predicted, truth])]
        for truth in range(1, len(names))
        for predicted in range(1, len(names))
    ]
    columns: list[str | int] = ["Actual", "Predicted", "nPredictions"]
    fields = {str(name): name for name in columns}
    return plot_table("wandb/confusion_matrix/v1", wandb.Table(columns, pairs), fields)
