"""Pictures while training: prediction, truth and errors of sweeps all over each validation."""

from pathlib import Path
from typing import Any

import lightning as L
from lightning.pytorch.callbacks import Callback
from lightning.pytorch.loggers import WandbLogger
from matplotlib.figure import Figure

from most.datasets.taxonomy import Taxonomy
from most.inference import Prediction
from most.structures import Panoptic, Sample
from most.viz.bev import draw_bev, save


class BevPictures(Callback):
    """Draws ``number`` sweeps a validation, evenly spread; W&B gets them as images, ``folder`` as PNG files."""

    def __init__(self, number: int, folder: Path, prefix: str = "") -> None:
        self.number = number
        self.folder = folder
        self.prefix = prefix  # of the images' names

    def on_validation_batch_end(
        self,
        trainer: L.Trainer,
        pl_module: Any,
        outputs: Any,
        batch: list[Sample],
        batch_idx: int,
        dataloader_idx: int = 0,
    ) -> None:
        """Draw the batch's first sweep when its turn has come."""
        batches = int(sum(trainer.num_val_batches))
        due = sorted({round((turn + 0.5) * batches / self.number - 0.5) for turn in range(self.number)})
        if batch_idx not in due or not trainer.is_global_zero:
            return
        sample, prediction = batch[0].to("cpu"), outputs["predictions"][0].to("cpu")
        figure = draw_prediction(sample, prediction, pl_module.taxonomy)
        name = f"{sample.sequence}_{sample.index:06d}"
        save(figure, self.folder / f"epoch_{trainer.current_epoch:03d}" / f"{name}.png")
        if isinstance(trainer.logger, WandbLogger):
            key = f"{self.prefix}val/bev_{due.index(batch_idx) + 1}"
            trainer.logger.log_image(key, [figure], trainer.global_step, caption=[name])


def draw_prediction(sample: Sample, prediction: Prediction, taxonomy: Taxonomy) -> Figure:
    """Draw one sweep's prediction, beside its truth where that is known."""
    truth = None
    if sample.semantics is not None and sample.labels is not None:
        has_id = taxonomy.is_thing(sample.semantics) & (taxonomy.instance_of(sample.labels) != 0)
        truth = Panoptic(sample.semantics, sample.labels.where(has_id, 0))
    return draw_bev(
        sample.points[: sample.num_current],
        truth,
        prediction.panoptic,
        prediction.detections,
        sample.instances,
        taxonomy.class_names,
        taxonomy.colours,
        taxonomy.things,
        title=f"sequence {sample.sequence}, sweep {sample.index:06d}",
    )
