"""The notebooks: kept without outputs, and running from the first cell to the last."""

import re
from pathlib import Path

import nbformat
import pytest
import torch
from nbclient import NotebookClient
from nbformat import NotebookNode

from most.assembly import describe
from most.detections import PeakDetector
from most.inference import Inference
from most.membership import PointSegMLPSettings
from tiny import CAR, TAXONOMY, tiny_parts, tiny_predictor

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
FIGURES = {"scan_and_modal_labels": 6, "extent_strategies": 3, "membership_of_neighbours": 3}


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No data and no checkpoint but the test's own; kernels, IPython and matplotlib write to its folder."""
    for name in ("SEMANTICKITTI_ROOT", "MOST_CHECKPOINT"):
        monkeypatch.delenv(name, raising=False)
    for name in ("IPYTHONDIR", "JUPYTER_RUNTIME_DIR", "TMPDIR"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")


def run(path: Path, folder: Path) -> list[NotebookNode]:
    """All that the cells of a notebook put out, run in ``folder``; an error in any of them is raised."""
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    return [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]


def figures(outputs: list[NotebookNode]) -> int:
    return sum("image/png" in output.get("data", {}) for output in outputs)


def test_all_notebooks_are_known() -> None:
    assert {path.stem for path in NOTEBOOKS} == set(FIGURES)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_outputs_are_stripped(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        assert set(cell.metadata) == set()
        if cell.cell_type == "code":
            assert (cell.outputs, cell.execution_count) == ([], None)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_runs_and_draws(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looks_into_a_model = path.stem == "membership_of_neighbours"
    if looks_into_a_model:
        monkeypatch.setenv("MOST_CHECKPOINT", str(sees_cars_everywhere(tmp_path / "some.ckpt")))
    outputs = run(path, tmp_path)
    assert figures(outputs) == FIGURES[path.stem]
    if looks_into_a_model:
        said = "".join(output.get("text", "") for output in outputs)
        one, other, points = re.search(r"car (\d+) beside car (\d+): (\d+) points", said).groups()
        assert one != other
        assert int(points) > 0


def sees_cars_everywhere(path: Path) -> Path:
    """A checkpoint of a model whose every peak is a car of some metres."""
    changes = {"membership": PointSegMLPSettings([4]), "inference": Inference(PeakDetector(window=1, overlap=0.0))}
    predictor = tiny_predictor(**changes)
    with torch.no_grad():
        predictor.network.centre_head.heatmap.bias[0] = 5.0
        predictor.network.centre_head.regression.bias[3:6] = 1.5  # logarithms of half-sizes
        predictor.network.semantic_head.voxel.bias[CAR - 1] = 50.0
    parts = predictor.modules().items()
    state = {f"{name}.{key}": value for name, part in parts for key, value in part.state_dict().items()}
    torch.save({"most": describe(tiny_parts(**changes), TAXONOMY, 0), "state_dict": state, "most_run": {}}, path)
    return path
