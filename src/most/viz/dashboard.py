"""A W&B workspace as code: sections of panels over the keys that a training logs.

The layout is plain data; only ``workspace`` needs the package ``wandb-workspaces``.
"""

import importlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from most.errors import ConfigError

GROUPED_BY = ("choices.extent", "choices.membership", "choices.heads", "backbone.separate")  # of a run's configuration
PARTS = (  # of stage 1's loss; that of yaws is logged with amodal boxes, Lovász's where it weighs anything
    "heatmap", "voxel", "point", "lovasz", "offset", "height", "extent", "velocity", "yaw",
)  # fmt: skip
QUALITY = ("pq", "pq_things", "pq_stuff", "sq", "rq", "miou", "pq_present", "miou_present")
ACCURACY = ("membership_accuracy", "membership_accuracy_contested")
STAGE2 = "membership/"  # before the keys of stage 2
RATES = ("learning_rate", "lr-SGD")  # of stage 1, whatever its optimiser, and of stage 2


@dataclass
class Panel:
    """One panel: curves over the training, a gallery of pictures, a table, or a confusion matrix."""

    kind: str  # curves, pictures, table or confusion
    title: str
    keys: list[str]  # as runs log them


@dataclass
class Section:
    """Panels under a heading."""

    name: str
    panels: list[Panel]


def layout(class_names: Sequence[str], pictures: int) -> list[Section]:
    """Return the sections for runs of both stages.

    ``class_names`` are those with curves of their own; ``pictures`` are as many as runs log.
    """
    sections = [
        Section("Losses", [_curve(f"{before}train/loss") for before in ("", STAGE2)]),
        Section("Panoptic quality", [_compared(name) for name in QUALITY]),
        Section("By class", _by_class("", class_names) + _by_class(STAGE2, class_names)),
        Section("Membership", [_compared(name) for name in ACCURACY]),
        Section("Bird's-eye view", [_gallery(pictures, before) for before in ("", STAGE2)] if pictures else []),
        Section("Throughput", [_curve(f"{before}train/scans_per_second") for before in ("", STAGE2)]),
    ]
    sections[0].panels += [_curve(f"train/loss_{part}") for part in PARTS]
    sections[-1].panels += [_curve(name) for name in RATES]
    return [section for section in sections if section.panels]


def _curve(key: str) -> Panel:
    return Panel("curves", key, [key])


def _compared(name: str) -> Panel:
    """A figure after stage 1, of the nearest centre's labels beside stage 2, and of stage 2's own."""
    return Panel("curves", name, [f"val/{name}", f"{STAGE2}val/nearest_{name}", f"{STAGE2}val/{name}"])


def _by_class(before: str, class_names: Sequence[str]) -> list[Panel]:
    curves = Panel("curves", f"{before}class_pq", [f"{before}val/class_pq/{name}" for name in class_names])
    table = Panel("table", f"{before}per_class", [f"{before}val/per_class"])
    confusion = Panel("confusion", f"{before}confusion_matrix", [f"{before}val/confusion_matrix_table"])
    return [curves, table, confusion]


def _gallery(pictures: int, before: str) -> Panel:
    keys = [f"{before}val/bev_{number}" for number in range(1, pictures + 1)]
    return Panel("pictures", f"{before}bev", keys)


def describe(sections: Sequence[Section]) -> dict[str, Any]:
    """Return a layout as plain data, to look at without an account."""
    return {"grouped_by": list(GROUPED_BY), "sections": [asdict(section) for section in sections]}


def workspace(sections: Sequence[Section], entity: str, project: str, name: str) -> Any:
    """Return the ``Workspace`` that ``save()`` publishes: averages over the runs of an extent and membership."""
    spaces = _package("wandb_workspaces.workspaces")
    made = [spaces.Section(each.name, [_panel(panel) for panel in each.panels], is_open=True) for each in sections]
    grouped = spaces.RunsetSettings(groupby=[_package("wandb_workspaces.expr").Config(key) for key in GROUPED_BY])
    return spaces.Workspace(entity=entity, project=project, name=name, sections=made, runset_settings=grouped)


def _panel(panel: Panel) -> Any:
    reports = _package("wandb_workspaces.reports.v2")
    if panel.kind == "curves":
        return reports.LinePlot(title=panel.title, y=panel.keys)
    if panel.kind == "pictures":
        return reports.MediaBrowser(title=panel.title, media_keys=panel.keys)
    if panel.kind == "table":
        return reports.WeavePanelSummaryTable(table_name=panel.keys[0])
    columns = {name: name for name in ("Actual", "Predicted", "nPredictions")}
    return replace(
        reports.CustomChart.from_table(panel.keys[0], columns, {"title": panel.title}),
        chart_name="wandb/confusion_matrix/v1",
    )


def _package(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"publish: expected the package wandb-workspaces, found none; pip install 'most-lidar[dashboard]' ({error})"
        ) from error
