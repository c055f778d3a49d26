"""The wheel has all it needs: it runs from its own files alone, anywhere."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def run(folder: Path, *arguments: str, path: Path | None = None) -> str:
    """Run Python in ``folder`` and return what it prints; modules come from ``path`` first."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    if path is not None:
        environment["PYTHONPATH"] = str(path)
    done = subprocess.run(
        [sys.executable, "-P", *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    run(ROOT, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder))
    (made,) = folder.glob("most_lidar-*.whl")
    return made


@pytest.fixture(scope="module")
def site(wheel) -> Path:
    """A folder in which the wheel alone is installed."""
    folder = wheel.parent / "site"
    run(wheel.parent, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--no-compile",
        "--disable-pip-version-check", "--target", str(folder), str(wheel))  # fmt: skip
    return folder


def test_the_wheel_holds_every_module_configuration_and_taxonomy(wheel):
    sources = {f"most/{path.relative_to(ROOT / 'src' / 'most')}" for path in (ROOT / "src" / "most").rglob("*.py")}
    configurations = {f"most/conf/{path.relative_to(ROOT / 'conf')}" for path in (ROOT / "conf").rglob("*.yaml")}
    held = {name for name in zipfile.ZipFile(wheel).namelist() if name.startswith("most/")}
    assert {"most/conf/train.yaml", "most/datasets/taxonomies/semantickitti.yaml"} <= held
    assert sources | configurations <= held
    assert not [name for name in held if name.endswith((".pyc", ".bin", ".label", ".ckpt"))]


def test_training_composes_from_the_packed_configuration(site, tmp_path):
    printed = run(tmp_path, "-m", "most.train", "--cfg", "job", "+experiment=semkitti_max", path=site)
    for line in ("sweeps: 10", "- 0.075", "max_lr: 0.001", "epochs: 20"):
        assert line in printed, line
    assert not any(tmp_path.iterdir())


def test_it_is_the_wheels_own_copy_that_runs(site, tmp_path):
    code = """
import sys, most.train
from most.config import conf_dir
from most.datasets.taxonomy import Taxonomy
print(most.__file__, conf_dir(), Taxonomy.load("semantickitti").num_classes, sep="\\n")
print([module.__file__ for name, module in sys.modules.items() if name.split(".")[0] == "most"])
"""
    package, conf, classes, modules = run(tmp_path, "-c", code, path=site).splitlines()
    assert Path(package) == site / "most" / "__init__.py"
    assert Path(conf) == site / "most" / "conf"
    assert classes == "20"
    assert str(ROOT) not in modules
