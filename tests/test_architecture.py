"""Dependencies point one way: reads the imports of every module and holds them against docs/architecture.md."""

import ast
import builtins
import dis
import importlib
from pathlib import Path
from types import CodeType

import pytest

import most

ROOT = Path(most.__file__).parent
FOUNDATION = {"structures", "errors", "files", "keys", "processes", "geometry"}
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
    "heads": {"norm", "normed_linear"},
    "losses": {"modal"},
    "detections": {"voxels"},
    "membership": {"voxels", "normed_linear"},
    "panoptic": {"membership"},
    "tracking": set(),
    "metrics": {"datasets", "membership"},
    "reports": {"metrics"},
    "simulation": {"datasets"},
}
LAYERS = [  # above the components: each knows all that are before it; docs/architecture.md says the same
    ["claims", "device", "entry", "logs", "network", "run_folder", "submission"],
    ["inference", "relabelling"],
    ["ladder", "predictions", "stages", "viz"],
    ["config"],
    ["assembly"],
    ["streaming", "training"],
    ["checks", "predicting"],
    ["predicting_scans", "sweeps"],
]
EXTRAS = {"rerun"}  # packages that a module may need which is imported only when it is asked for
COMMANDS = [
    "compare", "dashboard", "draw", "evaluate", "oracle", "predict", "report", "simulate", "submit", "track", "train",
    "velocity", "view",
]  # fmt: skip


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


def test_what_is_above_knows_the_layers_below_and_nobody_knows_a_command():
    below = FOUNDATION | set(COMPONENTS)
    for layer in [*LAYERS, COMMANDS]:
        for name, path in files():
            if name in layer:
                assert imported(path) <= below | {name}, path
        below |= set(layer)


def test_every_module_has_its_place():
    placed = [*FOUNDATION, *COMPONENTS, *(name for layer in LAYERS for name in layer), *COMMANDS]
    assert sorted(placed) == sorted({name for name, _ in files()})


def test_the_order_is_the_documented_one():
    documented = " ".join((Path(__file__).parents[1] / "docs" / "architecture.md").read_text().split())
    order = " <- ".join(", ".join(layer) for layer in LAYERS)
    assert f"components <- {order} <- commands" in documented


def test_mathematics_runs_without_lightning_and_hydra():
    for name, path in files():
        if name in COMPONENTS and path.stem != "datamodule":
            text = path.read_text()
            assert "import lightning" not in text, path
            assert "import hydra" not in text, path
            assert "from hydra" not in text, path


def test_entry_points_and_files_stay_short():
    assert all(len(path.read_text().splitlines()) <= 300 for _, path in files())
    for name in COMMANDS:
        assert len((ROOT / f"{name}.py").read_text().splitlines()) <= 80, name


def nested(code):
    """A code object and all that are defined in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from nested(constant)


@pytest.mark.parametrize("path", sorted(ROOT.rglob("*.py")), ids=lambda path: str(path.relative_to(ROOT)))
def test_every_name_is_defined(path):
    """The linters cannot tell: for them, jaxtyping's words for axes are names without a definition."""
    name = ".".join(("most", *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__")
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS:
            raise
        pytest.skip(f"without the extra package {error.name}")
    used = {
        instruction.argval
        for code in nested(compile(path.read_text(), path, "exec"))
        for instruction in dis.get_instructions(code)
        if instruction.opname == "LOAD_GLOBAL"
    }
    assert not {each for each in used if not hasattr(module, each) and not hasattr(builtins, each)}
