"""Which scenes each split has: the official ones of a version of the tables, or others."""

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import yaml

from most.datasets.reader import SPLITS
from most.datasets.splits import check_once
from most.errors import ConfigError

VERSIONS = ("v1.0-mini", "v1.0-trainval", "v1.0-test")


@cache
def official_scenes(version: str, split: str) -> list[str]:
    """Names of the official scenes; none where a version has no such split."""
    scenes = yaml.safe_load((Path(__file__).parent / "splits.yaml").read_text())
    return [f"scene-{number:04d}" for number in scenes[version][split]]


@dataclass
class SceneSplits:
    """Scenes of each split; those not given are the official ones."""

    train: list[str] | None = None
    val: list[str] | None = None
    test: list[str] | None = None

    def __post_init__(self) -> None:
        for split in SPLITS:
            check_once(split, getattr(self, split) or [])
            for name in getattr(self, split) or []:
                if not re.fullmatch(r"scene-[0-9]{4}", str(name)):
                    raise ConfigError(
                        f"dataset.splits.{split}: expected names such as scene-0061, found {name!r}; "
                        "the table scene.json lists those there are"
                    )

    def scenes(self, version: str, split: str) -> list[str]:
        """The scenes of a split, given or official."""
        given: list[str] | None = getattr(self, split)
        return official_scenes(version, split) if given is None else given
