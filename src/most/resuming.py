"""What a training still has to do, and which checkpoints it may go on from."""

from pathlib import Path
from typing import Any

from most.assembly import describe, model_parts, read_checkpoint
from most.config import Config
from most.datasets.taxonomy import Taxonomy
from most.errors import ConfigError
from most.membership import Nearest

STAGE1 = ("grid", "encoder", "backbone", "centre_head", "semantic_head")


def stages_to_run(config: Config, taxonomy: Taxonomy, folder: Path) -> list[str]:
    """Return the stages still to be trained; what does not fit is a ConfigError."""
    names: list[str] = config.stage.run
    check_folder(config, folder)
    if config.resume:
        return names[names.index(check_resume(config, taxonomy)) :]
    check_stage1(config, taxonomy)
    return names


def check_folder(config: Config, folder: Path) -> None:
    """Refuse a folder with another run's checkpoints, which would be overwritten."""
    kept = sorted((folder / "checkpoints").glob("*.ckpt"))
    if kept and not config.resume:
        raise ConfigError(
            f"hydra.run.dir: expected a folder without checkpoints, found {kept[0]}; "
            f"choose another one, or go on with resume={kept[0]}"
        )


def check_resume(config: Config, taxonomy: Taxonomy) -> str:
    """Return the stage that a run goes on with; refuse another model, or another number of epochs."""
    path = Path(str(config.resume))
    saved = read_checkpoint(path)
    stage: str = saved["most_stage"]
    if stage not in config.stage.run:
        raise ConfigError(f"resume: {path} is of stage {stage}; expected one of {', '.join(config.stage.run)}")
    parts = model_parts(config) | ({"membership": Nearest()} if stage == "detection" else {})
    if saved["most"] != describe(parts, taxonomy, config.dataset.sweeps):
        raise ConfigError(f"resume: {path} was trained with another model or dataset; repeat its own settings")
    epochs = getattr(config.stage, stage).epochs
    if saved["most_epochs"] != epochs:
        raise ConfigError(
            f"stage.{stage}.epochs: expected {saved['most_epochs']}, as the run of {path} began, found {epochs}; "
            "the learning rate's schedule is made for that length"
        )
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
    path = Path(config.stage1)
    saved, expected = read_checkpoint(path)["most"], describe(model_parts(config), taxonomy, config.dataset.sweeps)
    for name in ("taxonomy", "sweeps"):
        _check(path, name, expected[name], saved[name])
    for name in STAGE1:
        _check(path, name, expected["parts"][name], saved["parts"][name])


def _check(path: Path, name: str, expected: Any, found: Any) -> None:
    if expected != found:
        raise ConfigError(
            f"stage1: {path} was trained with another {name}: expected {expected}, found {found}; "
            "repeat the settings that stage 1 was trained with"
        )
