"""Dependencies point one way: reads the imports of every module and holds them against docs/architecture.md."""

import ast
from pathlib import Path

import most

ROOT = Path(most.__file__).parent
FOUNDATION = {"structures", "errors", "files", "processes", "geometry"}
COMPONENTS = {
    "datasets": {"modal"},
    "modal": set(),
    "sparse": set(),
    "voxels": set(),
    "norm": set(),
    "normed_linear": set(),
    "normed_pair": {"norm", "normed_linear"},
    "encoder": {"voxels", "normed_linear", "normed_pair"},
    "backbones": {"norm", "sparse"},
    "heads": {"norm"},
    "losses": {"modal"},
    "detections": {"voxels"},
    "membership": {"voxels", "normed_linear"},
    "panoptic": {"membership"},
    "tracking": set(),
    "metrics": {"datasets", "membership"},
    "reports": {"metrics"},
    "simulation": {"datasets"},
}
ENTRY_POINTS = {
    "train",
    "predict",
    "evaluate",
    "compare",
    "simulate",
    "draw",
    "submit",
    "track",
    "velocity",
    "view",
    "oracle",
    "report",
}
OUTER = {"entry", "config", "assembly", "training", "checks", "streaming", "predicting", "predicting_scans"}


def imported(path):
    """The packages or modules of ``most`` that a file imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("most."):
            found.add(node.module.split(".")[1])
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[1] for alias in node.names if alias.name.startswith("most.")}
    return found


def files():
    for path in ROOT.rglob("*.py"):
        name = path.relative_to(ROOT).parts[0].removesuffix(".py")
        if name != "__init__":
            yield name, path


def test_the_foundation_knows_nothing_above_it():
    for name, path in files():
        if name in FOUNDATION:
            assert imported(path) <= FOUNDATION, path


def test_components_know_the_foundation_and_their_stated_exceptions():
    for name, path in files():
        if name in COMPONENTS:
            assert imported(path) <= FOUNDATION | {name} | COMPONENTS[name], path


def test_nobody_imports_an_entry_point_and_nothing_below_the_configuration_imports_it():
    for name, path in files():
        others = imported(path) - {name}
        assert not others & ENTRY_POINTS, path
        if name not in ENTRY_POINTS | OUTER:
            assert not others & OUTER, path


def test_mathematics_runs_without_lightning_and_hydra():
    for name, path in files():
        if name in COMPONENTS and path.stem != "datamodule":
            text = path.read_text()
            assert "import lightning" not in text, path
            assert "import hydra" not in text, path
            assert "from hydra" not in text, path


def test_entry_points_and_files_stay_short():
    assert all(len(path.read_text().splitlines()) <= 300 for _, path in files())
    for name in ENTRY_POINTS:
        assert len((ROOT / f"{name}.py").read_text().splitlines()) <= 80, name
