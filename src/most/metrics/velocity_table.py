"""What ``velocity_gain`` found, as Markdown that reads well in a terminal."""

from collections.abc import Mapping
from typing import Any


def format_velocity_gain(report: Mapping[str, Any]) -> str:
    """LSTQ and links of both trackings, in percent; then errors of velocities, m/s."""
    return "\n\n".join(
        _markdown(rows)
        for rows in (_sequences(report["sequences"]), _trackings(report), _errors(report["velocity_error"]))
    )


def _sequences(sequences: Mapping[str, Mapping[str, float]]) -> list[list[str]]:
    head = ["LSTQ of", "nearest", "velocity", "difference"]
    return [head, *([name, *_percents(each["nearest"], each["velocity"])] for name, each in sequences.items())]


def _trackings(report: Mapping[str, Any]) -> list[list[str]]:
    lstq, links = report["lstq"], report["links"]
    means = _percents(lstq["nearest"], lstq["velocity"])
    means[-1] += f" (95 %: {100 * lstq['low']:+.1f} to {100 * lstq['high']:+.1f})"
    head = [f"{len(report['sequences'])} sequences, {report['scans']} scans", "nearest", "velocity", "difference"]
    titles = {"all": "links kept", "moving": "links kept of moving objects"}
    return [head, ["LSTQ, mean", *means], *([title, *_links(links[kind])] for kind, title in titles.items())]


def _links(links: Mapping[str, Mapping[str, int]]) -> list[str]:
    """Counts, and the difference of the shares in percent points."""
    nearest, velocity = links["nearest"], links["velocity"]
    total = nearest["kept"] + nearest["switched"]  # the same for both
    gained = 100 * (velocity["kept"] - nearest["kept"]) / max(total, 1)
    return [f"{each['kept']} of {total}" for each in (nearest, velocity)] + [f"{gained:+.1f}"]


def _errors(errors: Mapping[str, Any]) -> list[list[str]]:
    rows = {"all": errors, **errors["per_class"]}
    head = ["moving objects, velocity error in m/s", "objects", "predicted", "zero", "ratio"]
    return [head, *([name, *_error(each)] for name, each in rows.items())]


def _error(each: Mapping[str, float]) -> list[str]:
    if not each["objects"]:
        return ["0", "-", "-", "-"]
    ratio = each["predicted"] / each["zero"]
    return [str(each["objects"]), *(f"{number:.2f}" for number in (each["predicted"], each["zero"], ratio))]


def _percents(nearest: float, velocity: float) -> list[str]:
    return [f"{100 * nearest:.1f}", f"{100 * velocity:.1f}", f"{100 * (velocity - nearest):+.1f}"]


def _markdown(rows: list[list[str]]) -> str:
    """A table whose columns line up; the first row is its head."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [[cell.ljust(width) for cell, width in zip(row, widths, strict=True)] for row in rows]
    lines.insert(1, ["-" * width for width in widths])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
