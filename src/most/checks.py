"""What a training is asked to do, held against what there is, before any work."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch

from most.assembly import (
    check_membership,
    describe,
    describe_run,
    model_parts,
    read_checkpoint,
    stage1_parts,
    stage1_run,
)
from most.config import Config, from_plain, from_settings, to_plain
from most.datasets.augment import Augment
from most.datasets.instances import check_extent
from most.datasets.reader import Reader
from most.datasets.taxonomy import Taxonomy
from most.errors import ConfigError
from most.keys import check_same, flat
from most.membership import PointSegMLPSettings
from most.modal.extent import DropSmall
from most.stages.trainer import MIXED, TrainerSettings
from most.training import METRICS, batches_per_step, checkpoint_path, resumed_file, stage1_file, standing
from most.voxels import Grid

NETWORK = ("encoder", "backbone", "centre_head", "semantic_head")
STAGE1 = ("grid", *NETWORK)


def stages_to_run(config: Config, reader: Reader, folder: Path) -> list[str]:
    """Return the stages still to be trained in the run's ``folder``; what does not fit is a ConfigError."""
    names: list[str] = config.stage.run
    check_devices(config.trainer)
    config.logger.check_account()
    for split in ("train", "val"):
        scans = len(reader.frames(split))  # raises where the dataset is not there
        if scans < config.trainer.processes():
            raise ConfigError(
                f"trainer.devices: expected at most as many processes as split {split} has scans, {scans}, "
                f"found {config.trainer.processes()}"
            )
        check_extent(config.extent, reader, split)
    for name in names:
        batches_per_step(config, name)
    check_dropped(config)
    if "membership" in names:
        check_learnable(config)
    check_membership(model_parts(config) if "membership" in names else stage1_parts(config))
    if config.resume:
        return names[names.index(check_resume(config, reader, folder)) :]
    check_folder(folder)
    check_stage1(config, reader.taxonomy)
    check_weights(config, reader.taxonomy)
    return names


def check_learnable(config: Config) -> None:
    """Refuse a stage 2 that has no detected centres to learn on, or nothing to learn."""
    if config.heads.centre.gives == "offsets":
        raise ConfigError(
            "heads: expected modal_centres, whose regions stage 2 learns on, found offset_regression; with it say "
            "stage=detection"
        )
    if not isinstance(config.membership, PointSegMLPSettings):
        raise ConfigError(
            "membership: expected one that stage 2 can train, such as full, found "
            f"{to_plain('membership', config.membership)['component']}; with it say stage=detection"
        )


def check_dropped(config: Config) -> None:
    """Refuse to drop no instance that is not dropped anyway: that would be another strategy's figures."""
    already = config.stage.detection.targets.min_points
    if isinstance(config.extent, DropSmall) and config.extent.min_points <= already:
        raise ConfigError(
            f"extent.min_points: expected more than stage.detection.targets.min_points = {already}, which leaves out "
            f"what has fewer points under every strategy, found {config.extent.min_points}; raise it, or lower that"
        )


def check_devices(trainer: TrainerSettings) -> None:
    """Refuse a GPU where there is none, more of them than there are, and on a CPU what only GPUs do."""
    there = 0 if trainer.accelerator == "cpu" else torch.cuda.device_count()
    if there:
        if trainer.devices > there:
            raise ConfigError(
                f"trainer.devices: expected no more GPUs than the {there} there are, found {trainer.devices}; "
                "say fewer, or trainer=cpu"
            )
        return
    if trainer.accelerator == "gpu":
        raise ConfigError("trainer.accelerator: expected a GPU, as trainer=gpu and ddp do, found none; say trainer=cpu")
    if trainer.devices < 0:
        raise ConfigError(f"trainer.devices: expected a number of processes on a CPU, found {trainer.devices}")
    if trainer.precision in MIXED:
        raise ConfigError(f"trainer.precision: expected 32-true or auto on a CPU, found {trainer.precision}")


def check_folder(folder: Path) -> None:
    """Refuse a folder with another run's checkpoints or figures, which would be overwritten."""
    if kept := [*sorted((folder / "checkpoints").glob("*.ckpt")), *folder.glob(METRICS)]:
        last = standing(folder)
        raise ConfigError(
            f"hydra.run.dir: expected a folder of no other run, found {kept[0]}; choose another one"
            + (f", or go on with resume={last}" if last else "")
        )


def check_resume(config: Config, reader: Reader, folder: Path) -> str:
    """Return the stage that a run goes on with; refuse another model, other settings, or another folder."""
    path = resumed_file(Path(str(config.resume)))
    saved = read_checkpoint(path)
    if "optimizer_states" not in saved:
        raise ConfigError(
            f"resume: expected a checkpoint to go on from, such as STAGE-last.ckpt, found weights alone: {path}"
        )
    stage: str = saved["most_run"]["stage"]
    if stage not in config.stage.run:
        raise ConfigError(f"resume: {path} is of stage {stage}; expected one of {', '.join(config.stage.run)}")
    parts = stage1_parts(config) if stage == "detection" else model_parts(config)
    expected = {
        "most": describe(parts, reader.taxonomy, config.dataset.sweeps),
        "most_run": describe_run(config, stage, reader.frames("train")),
    }
    for part, now in expected.items():
        began, goes_on = flat(_completed(saved[part], config)), flat(now)
        check_same(f"resume: {path}", began, goes_on, began | goes_on, "repeat the settings it began with")
    home = path.resolve().parents[1]
    if home != folder.resolve():
        raise ConfigError(f"resume: expected the run's own folder, found {folder}; add hydra.run.dir={home}")
    return stage


def check_stage1(config: Config, taxonomy: Taxonomy) -> None:
    """Refuse a stage 1 of another taxonomy, window, grid or network than the configuration's, or a needless one."""
    if "detection" in config.stage.run:
        if config.stage1 is not None:
            raise ConfigError("stage1: expected none where stage 1 is trained anew; say stage=membership to use it")
        return
    if config.stage1 is None:
        raise ConfigError(
            "stage1: expected a checkpoint of stage 1, found none; say stage1=FILE, or train it: stage=both"
        )
    saved = _check_same(config, taxonomy, "stage1", ("taxonomy", "sweeps"), STAGE1)
    if (extent := stage1_run(saved).get("extent")) is not None:
        trained_with = _completed_part("extent", extent)
        _check_equal("stage1", config.stage1, "extent", to_plain("extent", config.extent), trained_with)


def check_weights(config: Config, taxonomy: Taxonomy) -> None:
    """Refuse to begin with another network, or a network of other classes; its window and voxels may be others."""
    if config.weights is None:
        return
    if "detection" not in config.stage.run:
        raise ConfigError("weights: expected none where stage 1 is not trained; say stage=detection or stage=both")
    saved = _check_same(config, taxonomy, "weights", ("taxonomy",), NETWORK)
    trained: Grid = from_plain("grid", saved["most"]["parts"]["grid"])
    if trained.shape[2] != config.grid.shape[2]:
        raise ConfigError(
            f"weights: expected a grid of as many layers as this one, {config.grid.shape[2]}, "
            f"found {trained.shape[2]} in {config.weights}; choose another grid"
        )


def _check_same(
    config: Config, taxonomy: Taxonomy, key: str, told: tuple[str, ...], parts: tuple[str, ...]
) -> dict[str, Any]:
    """Return the checkpoint under ``key``; one of another model than the configuration's is a ConfigError.

    ``told`` names what it says of itself that has to agree, ``parts`` the components that have to.
    """
    place = Path(getattr(config, key))
    path = stage1_file(config, place)
    if place.is_dir():
        check_ended(key, checkpoint_path(place, "detection", "last"))
    checkpoint, expected = read_checkpoint(path), describe(model_parts(config), taxonomy, config.dataset.sweeps)
    saved = checkpoint["most"]
    pairs = {name: (expected[name], saved[name]) for name in told}
    pairs |= {name: (expected["parts"][name], _completed_part(name, saved["parts"][name])) for name in parts}
    for name, (wanted, found) in pairs.items():
        _check_equal(key, path, name, wanted, found)
    return checkpoint


def _check_equal(key: str, place: str | Path, name: str, wanted: Any, found: Any) -> None:
    if wanted != found:
        raise ConfigError(
            f"{key}: {place} was trained with another {name}: expected {wanted}, found {found}; "
            "repeat the settings that it was trained with"
        )


def check_ended(key: str, last: Path) -> None:
    """Refuse a run whose stage 1 has not ended: ``last`` is its newest checkpoint, unless it holds weights alone."""
    checkpoint = read_checkpoint(last)
    if "loops" not in checkpoint:
        return
    done = checkpoint["loops"]["fit_loop"]["epoch_progress"]["current"]["processed"]
    epochs = checkpoint["most_run"]["training"]["epochs"]
    if done < epochs:
        raise ConfigError(
            f"{key}: expected a run whose stage 1 has ended, found {done} of {epochs} epochs in {last}; "
            "let it end first, or name a checkpoint"
        )


def _completed(saved: dict[str, Any], config: Config) -> dict[str, Any]:
    """What a checkpoint says of its model or its run; settings that were added since have their defaults."""
    if "parts" in saved:
        return saved | {"parts": {group: _completed_part(group, part) for group, part in saved["parts"].items()}}
    training = type(getattr(config.stage, saved["stage"]))
    return saved | {
        "training": asdict(from_settings(training, "training", saved["training"])),
        "augment": asdict(from_settings(Augment, "augment", saved["augment"])),
        "extent": _completed_part("extent", saved["extent"]),
    }


def _completed_part(group: str, part: dict[str, Any]) -> dict[str, Any]:
    return to_plain(group, from_plain(group, part))
