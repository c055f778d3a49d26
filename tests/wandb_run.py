"""An offline W&B run, read back."""

import json
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass
class OfflineRun:
    """What a run told W&B."""

    name: str = ""
    group: str = ""
    config: dict[str, Any] = field(default_factory=dict)
    keys: set[str] = field(default_factory=set)  # logged at any step
    artifacts: dict[str, dict[str, Any]] = field(default_factory=dict)  # by kind
    files: list[str] = field(default_factory=list)  # media, below the run's folder
