"""An offline W&B run, read back."""

import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass
class OfflineRun:
    """What a run told W&B."""

    exit_code: int | None = None  # none where it has not ended
    name: str = ""
    group: str = ""
    config: dict[str, Any] = field(default_factory=dict)
    last: dict[str, Any] = field(default_factory=dict)  # by key, what was logged last
    artifacts: dict[str, list[str]] = field(default_factory=dict)  # names of files, by kind
    media: list[str] = field(default_factory=list)  # paths below the run's files

    def logged(self, key: str) -> bool:
        """Whether a key was logged; media is logged as several."""
        return any(each == key or each.startswith(f"{key}.") for each in self.last)


def read_run(folder: Path) -> OfflineRun:
    """Read the only offline run below ``folder``."""
    (binary,) = folder.rglob("*.wandb")
    run = OfflineRun(media=[str(path.relative_to(binary.parent / "files/media")) for path in _media(binary.parent)])
    for record in _records(binary):
        content = record[record["type"]]
        if record["type"] == "run" and "config" in content:
            run.name, run.group = content["display_name"], content.get("run_group", "")
            run.config = content["config"]["update"]
        if record["type"] == "exit":
            run.exit_code = content.get("exit_code", 0)
        if record["type"] == "history":
            run.last |= content["item"]
        if record["type"] == "artifact":
            run.artifacts[content["type"]] = [each["path"] for each in content["manifest"]["contents"]]
    return run


def _records(binary: Path) -> list[dict[str, Any]]:
    command = [sys.executable, "-m", "wandb", "leet", "inspect", "--json", str(binary)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


def _media(folder: Path) -> Iterator[Path]:
    return (path for path in sorted((folder / "files" / "media").rglob("*")) if path.is_file())
