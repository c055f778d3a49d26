"""Reports as JSON files, and as tables to read."""

import json
import math
import re
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from most.errors import DataError
from most.files import atomic_write
from most.metrics.paper_tables import PaperRow

WIDTH = 120  # of a terminal, characters
NUMBERS = re.compile(r"\[[-+.,\w\s]*\]")  # a list of numbers takes one line
COLUMNS = ("pq", "sq", "rq", "iou")
COUNTS = ("tp", "fp", "fn")


def write_report(path: Path, report: Mapping[str, Any]) -> None:
    """Write a report as JSON, whole or not at all; what is not a number becomes null."""
    with atomic_write(path, "w") as file:
        text = json.dumps(_without_nan(report), indent=2, allow_nan=False)
        file.write(NUMBERS.sub(lambda found: " ".join(found[0].split()), text) + "\n")


def read_report(path: Path) -> dict[str, Any]:
    """Read a report; raises DataError for a file that is none."""
    try:
        report = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: expected a report of most.evaluate or most.train, found none ({error})") from error
    if not isinstance(report, dict) or not isinstance(report.get("panoptic"), dict):
        raise DataError(f'{path}: expected a report with a section "panoptic", found other JSON; choose another')
    return report


def _without_nan(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without_nan(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def format_table(panoptic: Mapping[str, Any], things: Collection[str]) -> str:
    """The section ``panoptic`` of a report in percent: a line a class, things (by name) first, and the means below."""
    classes = panoptic["per_class"]
    width = max(len(name) for name in (*classes, "things present"))
    order = sorted(classes, key=lambda name: name not in things)
    rule = "-" * len(_line(width, "", [""] * len(COLUMNS), [""] * len(COUNTS)))
    lines = [_line(width, "class", ["PQ", "SQ", "RQ", "IoU"], ["TP", "FP", "FN"]), rule]
    lines += [_class_line(width, name, classes[name]) for name in order]
    lines.append(rule)
    for title, part in {"all": "", "things": "_things", "stuff": "_stuff"}.items():
        for present in ("", "_present"):
            means = [_percent(panoptic[f"{name}{part}{present}"]) for name in ("pq", "sq", "rq", "miou")]
            lines.append(_line(width, title + present.replace("_", " "), means, [""] * len(COUNTS)).rstrip())
    lines.append(rule)
    lines += [
        f"{title:<{width}}  {_percent(panoptic.get(key)):>6}"
        for title, key in {
            "PQ dagger": "pq_dagger",
            "membership": "membership_accuracy",
            "  contested": "membership_accuracy_contested",
        }.items()
    ]
    return "\n".join(lines)


def format_row(row: PaperRow, width: int = WIDTH) -> str:
    """A row of the paper's in percent below its columns, as many side by side as lines of ``width`` hold."""
    blocks: list[tuple[str, str]] = [("", "")]
    for title, figure in row.figures.items():
        size = max(len(title), 5) + 2
        if len(blocks[-1][0]) + size > width:
            blocks.append(("", ""))
        head, line = blocks[-1]
        blocks[-1] = head + f"{title:>{size}}", line + f"{_percent(figure):>{size}}"
    return "\n".join([row.title, *(text for block in blocks for text in block)])


def _class_line(width: int, name: str, row: Mapping[str, float]) -> str:
    """A class that neither the truth nor the prediction has shows dashes, though it enters the means as 0."""
    absent = not any(row[key] for key in ("iou", *COUNTS))
    figures = ["-" if absent else _percent(row[key]) for key in COLUMNS]
    return _line(width, name, figures, [str(row[key]) for key in COUNTS])


def _line(width: int, title: str, figures: list[str], counts: list[str]) -> str:
    return f"{title:<{width}}" + "".join(f"  {figure:>6}" for figure in figures) + "".join(f"{n:>8}" for n in counts)


def _percent(value: float | None) -> str:
    return "-" if value is None or math.isnan(value) else f"{100 * value:.1f}"
