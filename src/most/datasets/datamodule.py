"""Lightning's view of the datasets: a loader a split, batches of ``list[Sample]``."""

import signal

import lightning as L
from torch.utils.data import DataLoader

from most.datasets.augment import Augment
from most.datasets.dataset import WindowDataset
from most.datasets.instances import InstanceTables
from most.datasets.loaders import start_method
from most.datasets.nuscenes import PanopticNuScenes
from most.datasets.reader import Reader
from most.datasets.sampler import EpochSampler, OrderedSampler
from most.datasets.semantickitti import SemanticKITTI
from most.datasets.settings import DatasetSettings
from most.modal.instances import Extent
from most.structures import Sample


def standing(trainer: L.Trainer) -> tuple[int, int]:
    """Return the epoch that a trainer, resumed or not, is about to run, and how many of its batches it has behind it.

    A state that was saved after the last batch of an epoch counts as the beginning of the next one.
    """
    epochs, batches = trainer.fit_loop.epoch_progress.current, trainer.fit_loop.epoch_loop.batch_progress
    if batches.is_last_batch:
        return epochs.ready, 0
    return epochs.processed, batches.current.processed  # type: ignore[attr-defined]  # of the tracker it is at run time


class SweepDataModule(L.LightningDataModule):
    """Windows of any dataset's sweeps with modal instances; only training is augmented and shuffled.

    A trainer over several processes needs ``use_distributed_sampler=False``: the sampler here shares samples out.
    """

    reader: Reader

    def __init__(self, settings: DatasetSettings, augment: Augment, extent: Extent, seed: int = 0) -> None:
        """``extent`` says how large instances are; ``seed`` fixes order and augmentation."""
        super().__init__()
        self.settings = settings
        self.augment = augment
        self.seed = seed
        self.training_batch = settings.batch_size  # samples; a stage whose steps take several batches joins them
        self.reader = settings.reader()
        self.instances = InstanceTables(self.reader, extent, settings.tables)

    def prepare_data(self) -> None:
        """Make the instance tables that are needed, in one process, so that no other makes the same ones."""
        stage = self.trainer.state.fn if self.trainer else "fit"
        for split in {"fit": ["train", "val"], "predict": []}.get(stage or "fit", ["val"]):
            for sequence in self.reader.sequences(split):
                self.instances.table(sequence)

    def dataset(self, split: str, augment: Augment | None = None) -> WindowDataset:
        """The samples of a split, not augmented unless asked for."""
        settings, frames = self.settings, self.reader.frames(split)
        return WindowDataset(self.reader, frames, settings.sweeps, augment, self.instances, self.seed, settings.cache)

    def train_dataloader(self) -> DataLoader[Sample]:
        """Shuffled, augmented windows, from where the trainer stands on."""
        self.instances.learn()
        dataset = self.dataset("train", self.augment)
        epoch, batches = standing(self.trainer) if self.trainer else (0, 0)
        sampler = EpochSampler(dataset, self.seed, epoch, batches * self.training_batch)
        return self._loader(dataset, sampler, self.training_batch)

    def val_dataloader(self) -> DataLoader[Sample]:
        """The validation split in order."""
        return self.loader("val")

    def test_dataloader(self) -> DataLoader[Sample]:
        """The validation split again: the test split has no labels to test against."""
        return self.loader("val")

    def predict_dataloader(self) -> DataLoader[Sample]:
        """The test split in order."""
        return self.loader("test")

    def loader(self, split: str) -> DataLoader[Sample]:
        """Any split in order, not augmented."""
        dataset = self.dataset(split)
        return self._loader(dataset, OrderedSampler(dataset), self.settings.batch_size)

    def _loader(
        self, dataset: WindowDataset, sampler: EpochSampler | OrderedSampler, batch_size: int
    ) -> DataLoader[Sample]:
        return DataLoader(
            dataset,
            batch_size,
            sampler=sampler,
            num_workers=self.settings.workers,
            multiprocessing_context=start_method(self.settings.workers),
            persistent_workers=self.settings.workers > 0,
            collate_fn=list,
            worker_init_fn=_leave_interrupts_to_the_main_process,
        )


class SemanticKITTIDataModule(SweepDataModule):
    """Every scan of SemanticKITTI, real or simulated, with those before it."""

    reader: SemanticKITTI


class PanopticNuScenesDataModule(SweepDataModule):
    """The key frames of Panoptic nuScenes, real or simulated, each with the sweeps before it."""

    reader: PanopticNuScenes


def _leave_interrupts_to_the_main_process(_: int) -> None:
    """A terminal sends Ctrl-C to all processes; the step that the main one still ends needs its loaders."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
