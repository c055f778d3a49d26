from contextlib import nullcontext
from pathlib import Path

import lightning as L
import pytest
import torch
from lightning.pytorch.callbacks import Callback
from omegaconf import OmegaConf

import nuscenes_tree
from most.datasets.augment import Augment
from most.datasets.datamodule import PanopticNuScenesDataModule, SemanticKITTIDataModule
from most.datasets.nuscenes import NuScenesSettings, SceneSplits
from most.datasets.reader import Frame
from most.datasets.sampler import EpochSampler, OrderedSampler
from most.datasets.semantickitti import SemanticKITTISettings, Splits
from most.errors import ConfigError, DataError
from most.modal.extent import ShrinkWrap
from most.structures import Sample


def module(tree: Path, **options: object) -> SemanticKITTIDataModule:
    splits = Splits(train=["00"], val=["08"], test=["11"])
    chosen = {"workers": 0, "sweeps": 1, "tables": str(tree / "tables")} | options
    settings = SemanticKITTISettings(str(tree), splits=splits, **chosen)  # type: ignore[arg-type]
    return SemanticKITTIDataModule(settings, Augment(rotation=45.0), ShrinkWrap(), seed=3)


def names(batches: object) -> list[list[tuple[str, int]]]:
    return [[(sample.sequence, sample.index) for sample in batch] for batch in batches]  # type: ignore[attr-defined]


def test_batches_are_lists_of_samples(tree: Path) -> None:
    data = module(tree, batch_size=2)
    data.prepare_data()
    batch = next(iter(data.train_dataloader()))
    assert [type(sample) for sample in batch] == [Sample, Sample]
    assert names(data.val_dataloader()) == [[("08", 0), ("08", 1)], [("08", 2)]]
    assert names(data.test_dataloader()) == names(data.val_dataloader())
    assert names(data.predict_dataloader()) == [[("11", 0), ("11", 1)]]


def test_only_training_is_augmented(tree: Path) -> None:
    data = module(tree)
    plain = data.dataset("train")[2].points
    assert torch.equal(data.loader("train").dataset[2].points, plain)
    assert not torch.equal(data.train_dataloader().dataset[2].points, plain)


def test_tables_are_made_before_training(tree: Path) -> None:
    module(tree).prepare_data()
    assert sorted(path.name for path in (tree / "tables").rglob("*.npz")) == ["00.npz", "08.npz"]


def test_missing_data_fails_before_training(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"most\.simulate"):
        module(tmp_path / "nowhere").prepare_data()


def test_order_is_shuffled_by_seed_and_epoch(tree: Path) -> None:
    dataset = module(tree).dataset("train")
    orders = {}
    for seed in (0, 1):
        for epoch in range(6):
            sampler = EpochSampler(dataset, seed)
            sampler.set_epoch(epoch)
            orders[seed, epoch] = tuple(sampler)
            assert sorted(sampler) == [0, 1, 2, 3]
            assert tuple(EpochSampler(dataset, seed, epoch)) == orders[seed, epoch]
    assert len(set(orders.values())) > 4


def test_processes_share_an_epoch_evenly(tree: Path) -> None:
    dataset = module(tree).dataset("train")
    shares = []
    for rank in range(3):
        sampler = EpochSampler(dataset, 0)
        sampler.rank, sampler.processes = rank, 3
        shares.append(list(sampler))
        assert len(sampler) == len(shares[-1]) == 2
    assert {index for share in shares for index in share} == {0, 1, 2, 3}


def test_processes_share_a_split_in_order_and_no_sample_twice(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = module(tree).dataset("train")
    shares = []
    for rank in range(3):
        monkeypatch.setattr("most.datasets.sampler.rank", lambda rank=rank: rank)
        monkeypatch.setattr("most.datasets.sampler.processes", lambda: 3)
        shares.append(list(OrderedSampler(dataset)))
        assert len(OrderedSampler(dataset)) == len(shares[-1])
    assert shares == [[0, 3], [1], [2]]


def test_an_epoch_goes_on_behind_what_was_done_and_the_next_is_whole(tree: Path) -> None:
    dataset = module(tree).dataset("train")
    whole = list(EpochSampler(dataset, 0, 2))
    sampler = EpochSampler(dataset, 0, 2, done=3)
    assert len(sampler) == 4
    assert list(sampler) == whole[3:]
    assert list(sampler) == whole


class Recorder(L.LightningModule):
    """Remembers what it was shown."""

    def __init__(self) -> None:
        super().__init__()
        self.weight = torch.nn.Parameter(torch.zeros(()))
        self.seen: list[tuple[int, int, float]] = []

    def training_step(self, batch: list[Sample]) -> torch.Tensor:
        self.seen += [(self.current_epoch, sample.index, float(sample.points.sum())) for sample in batch]
        return self.weight**2

    def configure_optimizers(self) -> torch.optim.Optimizer:
        return torch.optim.SGD(self.parameters(), lr=0.1)


class SaveAfter(Callback):
    """Saves after a number of steps, and stops there as abruptly as a crash."""

    def __init__(self, steps: int, path: Path) -> None:
        self.steps, self.path = steps, path

    def on_train_batch_end(self, trainer: L.Trainer, *_: object) -> None:
        if trainer.global_step == self.steps:
            trainer.save_checkpoint(self.path)
            raise RuntimeError("crash")


def fit(tree: Path, folder: Path, callback: Callback | None = None, resume: Path | None = None) -> list:
    quiet = {"logger": False, "enable_progress_bar": False, "enable_model_summary": False, "accelerator": "cpu"}
    callbacks = [callback] if callback else []
    trainer = L.Trainer(max_epochs=3, default_root_dir=folder, enable_checkpointing=False, callbacks=callbacks, **quiet)
    recorder = Recorder()
    with pytest.raises(RuntimeError, match="crash") if callback else nullcontext():
        trainer.fit(recorder, datamodule=module(tree, workers=2), ckpt_path=resume, weights_only=True)
    return recorder.seen


@pytest.mark.parametrize("steps", [1, 3, 4, 5, 8])  # within and at the end of epochs of 4 steps
def test_resumed_run_sees_what_it_would_have_seen(tree: Path, tmp_path: Path, steps: int) -> None:
    whole = fit(tree, tmp_path)
    first = fit(tree, tmp_path, SaveAfter(steps, tmp_path / "state.ckpt"))
    rest = fit(tree, tmp_path, resume=tmp_path / "state.ckpt")
    assert len(first) == steps
    assert first + rest == whole
    assert len({tuple(sorted(seen[1:] for seen in whole if seen[0] == epoch)) for epoch in range(3)}) == 3


@pytest.mark.parametrize(("key", "value"), [("sweeps", -1), ("batch_size", 0), ("workers", -2)])
def test_faulty_settings_are_refused(key: str, value: int) -> None:
    with pytest.raises(ConfigError, match=rf"dataset\.{key}: expected at least [01], found {value}"):
        SemanticKITTISettings(**{key: value})


def test_settings_are_a_structured_configuration() -> None:
    config = OmegaConf.merge(OmegaConf.structured(SemanticKITTISettings), {"sweeps": 3, "splits": {"val": ["07"]}})
    settings = OmegaConf.to_object(config)
    assert isinstance(settings, SemanticKITTISettings)
    assert settings.splits.val == ["07"]
    assert settings.splits.train[0] == "00"


def test_key_frames_of_nuscenes_come_with_the_sweeps_before_them(tmp_path: Path) -> None:
    root = nuscenes_tree.write_tree(tmp_path / "nuscenes", {"scene-0001": True, "scene-0003": True})
    splits = SceneSplits(train=["scene-0001"], val=["scene-0003"])
    settings = NuScenesSettings(str(root), splits=splits, sweeps=3, workers=0, tables=str(tmp_path / "tables"))
    data = PanopticNuScenesDataModule(settings, Augment(), ShrinkWrap())
    data.prepare_data()
    assert [path.name for path in sorted((tmp_path / "tables").rglob("*.npz"))] == ["scene-0001.npz", "scene-0003.npz"]
    samples = [sample for batch in data.val_dataloader() for sample in batch]
    assert [(sample.index, len(sample.points)) for sample in samples] == [(0, 8), (2, 24), (4, 32)]
    assert all(sample.num_current == 8 for sample in samples)
    assert len(data.reader.boxes(Frame("scene-0003", 0))) == 1
    instances = samples[1].instances
    assert instances is not None
    assert dict(zip(instances.keys.tolist(), instances.classes.tolist(), strict=True)) == {
        nuscenes_tree.CAR: 4, nuscenes_tree.CHILD: 7, nuscenes_tree.ADULT: 7
    }  # fmt: skip
    assert instances.velocity_known.all()
    car = instances.keys.tolist().index(nuscenes_tree.CAR)
    torch.testing.assert_close(instances.velocities[car], torch.tensor([-4.0, 0.0]))  # 1 m in 0.25 s, to the left
