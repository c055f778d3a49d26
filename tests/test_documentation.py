"""What the pages say: commands compose, links lead somewhere, and a figure that stands on two pages is the same."""

import importlib
import itertools
import re
import shlex
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch
from hydra import compose, initialize_config_dir
from hydra.core.override_parser.overrides_parser import OverridesParser

from most.config import conf_dir, typed

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted(ROOT.glob("*/*.md"))]
CODE = re.compile(r"^ {4,}(\S.*)$|`([^`\n]+)`", re.MULTILINE)  # an indented line, or words between backticks
LINK = re.compile(r"\]\((?!https?:)([^)#]*)(?:#([^)]*))?\)")


def _code(page: Path) -> list[str]:
    return ["".join(found) for found in CODE.findall(page.read_text())]


COMMANDS = sorted({code for page in PAGES for code in _code(page) if code.startswith("python -m most.")})
TARGETS = sorted({code for page in PAGES for code in _code(page) if code.startswith("make ")})


def _jobs(overrides: list[str]) -> Iterator[list[str]]:
    """The overrides of the first job that a sweep has, or of the only one, and of those that differ in one from it."""
    values = []
    for override in OverridesParser.create().parse_overrides(overrides):
        swept = override.is_sweep_override()
        key, line = override.get_key_element(), str(override.input_line)
        values.append([f"{key}={value}" for value in override.sweep_string_iterator()] if swept else [line])
    first = [each[0] for each in values]
    yield first
    for place, each in enumerate(values):
        yield from ([*first[:place], other, *first[place + 1 :]] for other in each[1:])


@pytest.fixture(autouse=True, scope="module")
def configurations():
    with initialize_config_dir(str(conf_dir()), version_base=None):
        yield


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_on_a_page_composes(command):
    name, *overrides = shlex.split(command.removeprefix("python -m most."), comments=True)
    importlib.import_module(f"most.{name}")  # registers its schemas
    for job in _jobs([each for each in overrides if each != "-m"]):
        typed(compose(name, job))


@pytest.mark.parametrize("line", TARGETS)
def test_every_target_on_a_page_is_one_of_the_makefile(line):
    known = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    words = shlex.split(line.split("&&")[0], comments=True)[1:]
    assert [word for word in words if "=" not in word and word not in known] == []


def _block(page: Path, opening: str) -> str:
    """The indented lines from the one that begins with these words up to the next paragraph."""
    block = page.read_text().split(f"\n    {opening}", 1)[1]
    lines = itertools.takewhile(lambda line: not line or line.startswith("    "), f"    {opening}{block}".splitlines())
    return textwrap.dedent("\n".join(lines))


def test_the_metrics_count_in_a_loop_of_ones_own(capsys):
    road, one_car = 40, 1 << 16 | 10
    true = torch.tensor([one_car] * 60 + [road] * 60)
    said = torch.tensor([one_car] * 45 + [road] * 75)  # a car's IoU of 3/4, a road's of 4/5
    exec(_block(ROOT / "README.md", "from most.datasets.taxonomy"), {"scans": [(said, true)] * 2})
    assert float(capsys.readouterr().out) == pytest.approx((3 / 4 + 4 / 5) / 19)


def _anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(page):
    for path, anchor in LINK.findall(page.read_text()):
        target = page.parent / path if path else page
        assert target.exists(), path
        assert not anchor or anchor in _anchors(target), anchor


def test_figures_in_the_readme_are_those_of_the_results():
    measured = (ROOT / "README.md").read_text().split("## Measured")[1].split("\n## ")[0]
    rows = [line for line in measured.splitlines() if line.startswith("|")]
    assert len(rows) > 20
    assert set(rows) - set((ROOT / "docs/results.md").read_text().splitlines()) == set()
