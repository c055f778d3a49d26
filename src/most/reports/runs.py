"""Finds training runs in a folder, at any depth, and reads what each was and what it reached.

A run is a folder with ``.hydra/`` (``config.yaml``, ``overrides.yaml``, ``hydra.yaml``), named as Hydra would, and,
once it is finished, ``metrics.json``. What ``most.evaluate`` said of its predictions may lie in ``evaluated/NAME.json``
beside it, where NAME is the membership that predicted (``full``, ``nearest``, ``clustering``, ...), unless the report
itself says what predicted.
"""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from most.errors import DataError
from most.metrics.report import read_report
from most.reports.strategy import Strategy, changed, strategy_of
from most.reports.sums import Sums, read_sums

FILES = ("config.yaml", "hydra.yaml", "overrides.yaml")
EVALUATED, VALIDATED, BESIDE = "evaluated", "validated", "beside"


@dataclass
class Scored:
    """One run scored in one way."""

    folder: Path
    source: str  # EVALUATED by most.evaluate; VALIDATED at the end of training; BESIDE: nearest centres, at that end
    seed: int
    strategy: Strategy
    config: Mapping[str, Any]
    choices: Mapping[str, Any]
    report: Mapping[str, Any]  # what most.evaluate or the training wrote
    sums: Sums
    stage1: str  # the folder in which its stage 1 was trained
    told: tuple[str, ...] | None  # what prediction was told besides defaults; None where no one can know


@dataclass
class Runs:
    """What a folder holds."""

    scored: list[Scored]
    left_out: dict[Path, str]  # runs that cannot be counted, and why


def find_runs(folder: Path) -> Runs:
    """Read all runs in a folder, but for damaged ones; raises DataError where there is none."""
    if not folder.is_dir():
        raise DataError(f"runs: expected a folder of runs of most.train, found no folder {folder}; check runs=...")
    runs = Runs([], {})
    for path in sorted(folder.rglob(".hydra")):
        if path.is_dir():
            try:
                _read(path.parent, runs)
            except DataError as error:
                runs.left_out[path.parent] = f"damaged: {error}"
    if not runs.scored and not runs.left_out:
        raise DataError(
            f"{folder}: expected runs of most.train (folders with .hydra and metrics.json), found none; check runs=..."
        )
    return runs


def _read(folder: Path, runs: Runs) -> None:
    """Add what a run was scored by, or why it cannot be; other programs' folders are none of ours.

    Of a damaged run, which is a DataError, nothing is added.
    """
    config = _yaml(folder / ".hydra" / FILES[0], dict)
    if "stage" not in config:
        return
    hydra, overrides = (
        _yaml(folder / ".hydra" / name, kind) for name, kind in zip(FILES[1:], (dict, list), strict=True)
    )
    runtime = _part(_part(hydra, "hydra"), "runtime")
    choices = _part(runtime, "choices")
    if not {"extent", "membership", "dataset"} <= choices.keys():
        raise DataError(f"{folder / '.hydra/hydra.yaml'}: expected hydra.runtime.choices of most.train, found none")
    try:
        strategy = strategy_of(config, choices, overrides)
        seed = int(config["seed"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(
            f"{folder / '.hydra/config.yaml'}: expected a configuration of most.train, found none ({error!r})"
        ) from error
    scored, left_out, stage1 = [], {}, _stage1(config, runtime, folder)
    for report, path, membership, section, source in _reports(folder, config, strategy.membership):
        if (sums := report[section].get("sums")) is None:
            left_out[path] = "has no sums of sequences: written by an earlier version"
            continue
        way = replace(strategy, membership=membership)
        sums, told = read_sums(sums, f"{path}"), _told(report) if source == EVALUATED else ()
        scored.append(Scored(folder, source, seed, way, config, choices, report, sums, stage1, told))
    runs.scored += scored
    runs.left_out |= left_out if scored or left_out else {folder: _unfinished(folder, config)}


def _reports(
    folder: Path, config: Mapping[str, Any], membership: str
) -> Iterator[tuple[Mapping[str, Any], Path, str, str, str]]:
    """Yield reports with their place, the membership scored, its section, and whence they are."""
    for path in sorted((folder / "evaluated").glob("*.json")):
        report = read_report(path)
        yield report, path, _predicted_by(report, path.stem, membership), "panoptic", EVALUATED
    path = folder / "metrics.json"
    if not path.is_file():
        return
    report = read_report(path)
    if "membership" not in config["stage"]["run"]:
        yield report, path, membership, "panoptic", VALIDATED
    elif isinstance(report.get("panoptic_nearest"), dict):  # else stage 1 wrote it, and stage 2 is not finished
        yield report, path, membership, "panoptic", VALIDATED
        yield report, path, "nearest", "panoptic_nearest", BESIDE


def _predicted_by(report: Mapping[str, Any], name: str, trained: str) -> str:
    """Name the membership that made evaluated predictions: as they say, else by the report's own ``name``."""
    told = _told(report)
    if told is None:
        return trained if trained.split(" ")[0] == name else name
    said = str(report["prediction"].get("membership", trained))
    return trained if said == "trained" else said + changed("membership", told)


def _told(report: Mapping[str, Any]) -> tuple[str, ...] | None:
    """Return what prediction was told besides defaults; None for a report that does not say."""
    prediction = report.get("prediction")
    return tuple(map(str, prediction.get("changed") or ())) if isinstance(prediction, Mapping) else None


def _stage1(config: Mapping[str, Any], runtime: Mapping[str, Any], folder: Path) -> str:
    """Return where stage 1 was trained, as it was called then: it, and folders that stand on it, may be moved."""
    if config.get("stage1") is None:
        return str(runtime.get("output_dir", folder))
    path = Path(os.path.normpath(Path(runtime.get("cwd", "")) / _resolved(config, "stage1")))
    return str(path.parents[1] if path.suffix == ".ckpt" and path.parent.name == "checkpoints" else path)


def _resolved(config: Mapping[str, Any], key: str) -> str:
    """Return a setting with what it refers to, as ``${seed}``; what cannot be found out stays as it was told."""
    try:
        return str(OmegaConf.create(dict(config))[key])
    except OmegaConfBaseException:
        return str(config[key])


def _part(settings: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a part of what Hydra wrote; an empty one where there is none."""
    part = settings.get(name)
    return part if isinstance(part, dict) else {}


def _unfinished(folder: Path, config: Mapping[str, Any]) -> str:
    if (folder / "metrics.json").is_file():
        return "unfinished: stage 2 has not ended"
    kept = sorted((folder / "checkpoints").glob("*-last.ckpt"))
    return f"unfinished: goes on with resume={folder} hydra.run.dir={folder}" if kept else "unfinished: no metrics.json"


def _yaml(path: Path, kind: type) -> Any:
    try:
        content = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise DataError(f"{path}: expected what Hydra wrote of a run, found none readable ({error})") from error
    if not isinstance(content, kind):
        raise DataError(f"{path}: expected a YAML {kind.__name__}, found {type(content).__name__}")
    return content
