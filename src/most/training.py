"""A training run put together: stages, trainer, callbacks, logger."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import lightning as L
import torch
from lightning.pytorch.callbacks import Callback, LearningRateMonitor, TQDMProgressBar
from lightning.pytorch.loggers import Logger

from most.assembly import (
    STAGE1_RUN,
    build_membership,
    build_network,
    build_predictor,
    describe,
    describe_run,
    load_trained,
    load_weights,
    model_parts,
    read_checkpoint,
    stage1_parts,
    training_of,
)
from most.config import Config
from most.datasets.class_counts import class_counts
from most.datasets.datamodule import SweepDataModule
from most.datasets.reader import Reader
from most.errors import ConfigError, named
from most.membership import PointSegMLP
from most.metrics.report import write_report
from most.run_folder import TOLD
from most.stages.callbacks import Throughput
from most.stages.checkpoints import AtomicCheckpointIO, BestCheckpoint, LastCheckpoint
from most.stages.detection import DetectionStage, DetectionTraining
from most.stages.membership import MembershipStage
from most.stages.settings import STAGES
from most.stages.stage import Stage
from most.viz.callback import BevPictures
from most.viz.class_tables import ClassTables

METRICS = "metrics.json"  # of a run; it is written at its end


def run_stage(
    name: str, config: Config, data: SweepDataModule, folder: Path, logger: Logger | bool, resume: str | None
) -> Stage:
    """Train one stage from its beginning, or from a checkpoint, to its end."""
    L.seed_everything(config.seed, workers=True)
    stage = build_stage(name, config, data, Path(resume or stage1_file(config, Path(config.stage1 or folder))))
    trainer = build_trainer(config, stage, folder, logger)
    trainer.fit(stage, datamodule=data, ckpt_path=resume, weights_only=True)
    if stage.report.get("epochs") != stage.epochs:
        trainer.validate(stage, datamodule=data, verbose=False)
    if trainer.is_global_zero and name == config.stage.run[-1]:
        write_report(folder / METRICS, stage.report)
    return stage


def build_stage(name: str, config: Config, data: SweepDataModule, stage1: Path) -> Stage:
    """Make a stage, and tell the data how large its batches are; ``stage1`` is read for stage 2 alone."""
    if name == "detection":
        data.training_batch = config.dataset.batch_size
        return build_detection(config, data)
    data.training_batch = config.dataset.batch_size * batches_per_step(config, name)
    return build_membership_stage(config, stage1, data.reader)


def build_detection(config: Config, data: SweepDataModule) -> DetectionStage:
    """Make the network and wire it for stage 1, which knows no membership that has to be trained."""
    taxonomy, parts = data.reader.taxonomy, stage1_parts(config)
    network = build_network(parts, taxonomy)
    if config.weights is not None:
        path = stage1_file(config, Path(config.weights))
        weights = read_checkpoint(path)["state_dict"]
        with named(path):
            load_weights(network, "network", weights)
    predictor = build_predictor(network, parts, taxonomy)
    training: DetectionTraining = training_of(config, "detection")
    balanced = training.losses.class_balance > 0
    counts = class_counts(data.reader, "train") if balanced else torch.ones(taxonomy.num_classes, dtype=torch.long)
    scans = len(data.reader.frames("train"))
    steps = training.epochs * steps_per_epoch(config, scans)
    return DetectionStage(predictor, taxonomy, counts, training, _notes(config, "detection", parts, data.reader), steps)


def steps_per_epoch(config: Config, scans: int) -> int:
    """Return the optimiser's steps in an epoch of stage 1; Lightning's own count would make the loaders too early."""
    batches = math.ceil(math.ceil(scans / config.trainer.processes()) / config.dataset.batch_size)
    return math.ceil(batches / batches_per_step(config, "detection"))


def batches_per_step(config: Config, stage: str) -> int:
    """Return how many batches of each process a stage takes in before its optimiser steps."""
    effective = getattr(config.stage, stage).batch_size
    return config.trainer.accumulated(effective, config.dataset.batch_size, stage)


def build_membership_stage(config: Config, stage1: Path, reader: Reader) -> MembershipStage:
    """Read stage 1 from a checkpoint and put a new membership after it."""
    parts, taxonomy = model_parts(config), reader.taxonomy
    trained = load_trained(stage1)
    predictor = replace(trained.predictor, settings=config.inference)
    membership = build_membership(parts, predictor.network, taxonomy)
    assert isinstance(membership, PointSegMLP)  # most.checks
    notes = _notes(config, "membership", parts, reader) | {STAGE1_RUN: trained.stage1}
    return MembershipStage(predictor, membership, taxonomy, config.stage.membership, notes, config.seed)


def _notes(config: Config, stage: str, parts: dict[str, Any], reader: Reader) -> dict[str, Any]:
    """Return what a stage's checkpoints say of themselves."""
    return {
        "most": describe(parts, reader.taxonomy, config.dataset.sweeps),
        "most_run": describe_run(config, stage, reader.frames("train")),
    }


def checkpoint_path(folder: Path, stage: str, which: str) -> Path:
    """Where a run keeps a stage's ``last`` or ``best`` weights."""
    return folder / "checkpoints" / f"{stage}-{which}.ckpt"


def standing(folder: Path) -> str | None:
    """Return the checkpoint with which a run in ``folder`` goes on, where it was stopped."""
    kept = [checkpoint_path(folder, stage, "last") for stage in reversed(STAGES)]
    return next((str(path) for path in kept if path.is_file()), None)


def resumed_file(place: Path) -> Path:
    """Return the checkpoint that a run goes on from: ``place`` itself, or the newest of the run in this folder."""
    if not place.is_dir():
        return place
    if (kept := standing(place)) is None:
        raise ConfigError(
            f"resume: expected a run's folder with checkpoints/STAGE-last.ckpt, found none in {place}; choose another "
            "one, name a checkpoint, or leave it out to train from the beginning"
        )
    return Path(kept)


def run_files(config: Config, folder: Path) -> dict[str, list[Path]]:
    """Return what a finished run leaves, by kind: its last model, its figures, and what it was told."""
    told = [folder / TOLD / name for name in ("config.yaml", "overrides.yaml")]
    model = checkpoint_path(folder, config.stage.run[-1], "last")
    return {"model": [model], "metrics": [folder / METRICS], "config": told}


def stage1_file(config: Config, place: Path) -> Path:
    """Return the stage 1 that stage 2 gets: ``place`` itself, or of the run in this folder.

    It is the last one where that run never validated on the way.
    """
    if not place.is_dir():
        return place
    best = checkpoint_path(place, "detection", "best")
    return best if config.stage.hand_over == "best" and best.is_file() else checkpoint_path(place, "detection", "last")


def build_trainer(config: Config, stage: Stage, folder: Path, logger: Logger | bool) -> L.Trainer:
    """Make Lightning's trainer from our settings."""
    settings = config.trainer
    return L.Trainer(
        accelerator=settings.accelerator,
        devices=settings.devices,
        strategy=settings.strategy,
        precision=settings.chosen_precision(),
        max_epochs=stage.epochs,
        check_val_every_n_epoch=settings.validate_every,
        log_every_n_steps=settings.log_every,
        num_sanity_val_steps=0,
        use_distributed_sampler=False,
        logger=logger,
        callbacks=_callbacks(config, stage, folder),
        plugins=[AtomicCheckpointIO()],
        enable_progress_bar=settings.progress_bar,
        enable_model_summary=False,
        default_root_dir=folder,
        **_steps(config, stage),
    )


def _steps(config: Config, stage: Stage) -> dict[str, Any]:
    """Return what Lightning does with stage 1's gradients; stage 2 gets its batches joined, and steps by itself."""
    if not isinstance(stage, DetectionStage):
        return {}
    clip = stage.training_settings.clip
    return {"accumulate_grad_batches": batches_per_step(config, stage.name), "gradient_clip_val": clip}


def _callbacks(config: Config, stage: Stage, folder: Path) -> list[Callback]:
    best, last = (checkpoint_path(folder, stage.name, which) for which in ("best", "last"))
    callbacks: list[Callback] = [
        BestCheckpoint(best, f"{stage.prefix}val/pq"),
        LastCheckpoint(last, config.trainer.save_every),
        Throughput(stage.prefix),
    ]
    if config.logger.kind != "none":
        callbacks += [LearningRateMonitor("step"), ClassTables(stage.prefix)]
    if config.logger.pictures:
        callbacks.append(BevPictures(config.logger.pictures, folder / "pictures" / stage.name, stage.prefix))
    if config.trainer.progress_bar:
        callbacks.append(TQDMProgressBar(leave=True))
    return callbacks
