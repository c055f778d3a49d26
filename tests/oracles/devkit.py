"""The official nuScenes devkit, run in its own environment: its pins are not those of this project.

``make devkit`` installs it into ``.devkit``; ``MOST_DEVKIT`` names another environment that has it.
"""

import os
import subprocess
from pathlib import Path

import pytest

FOLDER = Path(os.environ.get("MOST_DEVKIT") or Path(__file__).parents[2] / ".devkit").resolve()
PYTHON = FOLDER / "bin" / "python"

needs_devkit = pytest.mark.skipif(
    not PYTHON.is_file(), reason=f"{PYTHON} is not there: make devkit installs it, MOST_DEVKIT names its environment"
)


def devkit(script: str, *arguments: object) -> subprocess.CompletedProcess:
    """Run a script of this folder with the devkit's Python."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return subprocess.run(
        [str(PYTHON), str(Path(__file__).parent / script), *map(str, arguments)],
        env=clean | {"MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
