"""Lightning's view of SemanticKITTI trees, real or simulated: a loader a split, batches of ``list[Sample]``."""

import signal
from dataclasses import dataclass, field

import lightning as L
from torch.utils.data import DataLoader

from most.datasets.augment import Augment
from most.datasets.dataset import WindowDataset
from most.datasets.instances import InstanceTables
from most.datasets.sampler import EpochSampler, OrderedSampler
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.errors import ConfigError
from most.modal.instances import ExtentStrategy
from most.structures import Sample


@dataclass
class SemanticKITTISettings:
    """Where the tree is, which sequences to use, and how to load them."""

    root: str = "data/semantickitti"  # holds sequences/
    splits: Splits = field(default_factory=Splits)
    sweeps: int = 10  # previous sweeps beside the current one
    batch_size: int = 1
    workers: int = 2  # processes that load; 0 loads in the main process
    cache: bool = False  # keep sweeps in memory, in each worker; for datasets of a few hundred sweeps
    tables: str = "data/tables"  # where tables of modal instances are kept

    def __post_init__(self) -> None:
        for key, lowest in {"sweeps": 0, "batch_size": 1, "workers": 0}.items():
            if getattr(self, key) < lowest:
                raise ConfigError(f"dataset.{key}: expected at least {lowest}, found {getattr(self, key)}")


def standing(trainer: L.Trainer) -> tuple[int, int]:
    """Return the epoch that a trainer, resumed or not, is about to run, and how many of its batches it has behind it.

    A state that was saved after the last batch of an epoch counts as the beginning of the next one.
    """
    epochs, batches = trainer.fit_loop.epoch_progress.current, trainer.fit_loop.epoch_loop.batch_progress
    if batches.is_last_batch:
        return epochs.ready, 0
    return epochs.processed, batches.current.processed  # type: ignore[attr-defined]  # of the tracker it is at run time


class SemanticKITTIDataModule(L.LightningDataModule):
    """Windows of sweeps with modal instances; only training is augmented and shuffled.

    A trainer over several processes needs ``use_distributed_sampler=False``: the sampler here shares samples out.
    """

    def __init__(
        self, settings: SemanticKITTISettings, augment: Augment, extent: ExtentStrategy, seed: int = 0
    ) -> None:
        """``extent`` says how large instances are; ``seed`` fixes order and augmentation."""
        super().__init__()
        self.settings = settings
        self.augment = augment
        self.seed = seed
        self.training_batch = settings.batch_size  # samples; a stage whose steps take several batches joins them
        self.reader = SemanticKITTI(settings.root, settings.splits)
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
            persistent_workers=self.settings.workers > 0,
            collate_fn=list,
            worker_init_fn=_leave_interrupts_to_the_main_process,
        )


def _leave_interrupts_to_the_main_process(_: int) -> None:
    """A terminal sends Ctrl-C to all processes; the step that the main one still ends needs its loaders."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
