"""The page in a real browser: it shows all tables and plots, asks for nothing, and complains of nothing."""

import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import pytest

from example_runs import example_run, example_sweep
from most.reports.write import write_reports

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report on a sweep with one unfinished run, whose folder has a name that HTML has to escape."""
    folder = tmp_path_factory.mktemp("page")
    example_run(example_sweep(folder / "runs", seeds=2) / "a<b&c", None)
    write_reports(folder / "runs", folder / "out", None, draws=200, seed=1)
    return folder / "out" / "report.html"


def test_in_a_browser_tables_and_plots_are_there_and_nothing_is_wrong(page: Path, tmp_path: Path) -> None:
    if BROWSER is None:
        pytest.skip("no Chromium is installed")
    done = subprocess.run(
        [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--dump-dom",
         f"--user-data-dir={tmp_path}", page.as_uri()],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "CONSOLE" not in done.stderr
    assert done.stdout.count("<caption>") == 10  # orders, three tables with differences, IV, classes, left out
    assert done.stdout.count('<svg role="img"') == 5
    assert "a&lt;b&amp;c" in done.stdout


class Elements(HTMLParser):
    """All ids, and the elements still open."""

    def __init__(self) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.open: list[str] = []
        self.void = {"meta", "link", "br", "hr", "img"}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.ids += [value for key, value in attrs if key == "id" and value]
        if tag not in self.void:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_is_well_formed_stands_alone_and_has_a_name_for_everything(page: Path) -> None:
    text = page.read_text()
    elements = Elements()
    elements.feed(text)
    assert elements.open == []
    assert len(elements.ids) == len(set(elements.ids))
    assert set(re.findall(r'href="#([^"]+)"', text)) <= set(elements.ids)
    assert set(re.findall(r"url\(#([^)]+)\)", text)) <= set(elements.ids)
    assert not re.search(r'(src|href)="(?!#|data:)', text)
    assert "<script" not in text
    assert text.count("<caption>") == text.count("<table>")
    assert text.count("<svg ") == text.count('<svg role="img" aria-label="') == text.count("<figcaption>") == 5
    assert "#010203" not in text  # the plots' ink is the page's
    assert text.count("currentColor") > 20
    assert "prefers-color-scheme: dark" in text
