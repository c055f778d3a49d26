"""One figure of a scan in bird's-eye view: the truth, the prediction, and where they differ."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from torch import Tensor

from most.files import atomic_write
from most.structures import Detections, Instances, Panoptic
from most.viz.agreement import Agreement, Verdict, compare, segments
from most.viz.classes import ClassStyle
from most.viz.palette import GROUND, INK, VERDICTS, numbered, paint
from most.viz.panels import DPI, PANEL, class_legend, make_panels, name_panel
from most.viz.raster import rasterise

SLOW = 1.0  # m/s; no arrow below it: the modal centres of standing things move about as much


def draw_bev(
    points: Float[Tensor, "points channels"],
    truth: Panoptic | None,
    prediction: Panoptic,
    detections: Detections,
    instances: Instances | None,
    class_names: list[str],
    colours: list[list[int]],
    things: list[int],
    title: str = "",
    figures: Mapping[str, float] | None = None,
    reach: float = 50.0,
) -> Figure:
    """Return truth, prediction and errors side by side; without a truth, the prediction alone.

    ``points`` begin with x, y, z (m, sensor). Stuff has its class's colour (``colours``: RGB, 0 to 255, by training
    id), muted; each instance has one of its own, the same in truth and prediction where they agree. Marks and boxes are
    modal centres and extents, arrows a second of motion over the ground. The truth's ids must be unique within their
    class, as raw labels are. ``figures`` are fractions, shown in percent; ``reach`` (m) is how far the picture goes.
    """
    style, xyz = ClassStyle(class_names, colours, things), points[:, :3].detach().cpu().double().numpy()
    prediction, truth = prediction.to("cpu"), truth.to("cpu") if truth else None
    labels = [prediction.semantics] if truth is None else [prediction.semantics, truth.semantics]
    seen = [one for one in torch.unique(torch.cat(labels)).tolist() if one]
    figure, axes = make_panels(3 if truth else 1, title, figures or {}, class_legend(seen, style), reach)
    middle = axes[len(axes) // 2]
    taken: dict[int, int] = {}
    if truth:
        taken = _draw_truth(axes[0], axes[2], xyz, truth, prediction, instances, style, reach)
    _draw_labels(middle, xyz, prediction, taken, style, reach)
    _draw_objects(middle, detections, detections.velocities.norm(dim=1) > SLOW, style)
    name_panel(middle, "prediction", f"detections: {len(detections)}")
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG; a reader never sees half of it."""
    with atomic_write(path) as file:
        figure.savefig(file, format="png", dpi=DPI, facecolor=GROUND, pil_kwargs={"compress_level": 3})


def _draw_truth(
    left: Axes,
    right: Axes,
    xyz: Float[np.ndarray, "points 3"],
    truth: Panoptic,
    prediction: Panoptic,
    instances: Instances | None,
    style: ClassStyle,
    reach: float,
) -> dict[int, int]:
    """Draw the truth and the errors; return the places of the colours of predicted instances that the truth has too."""
    agreement = compare(truth, prediction, style.things)
    places = _draw_labels(left, xyz, truth, {}, style, reach)
    name_panel(left, "truth", f"instances: {len(places)}")
    _draw_errors(right, xyz, agreement, reach)
    if instances:
        moving = instances.velocity_known & (instances.velocities.norm(dim=1) > SLOW)
        _draw_objects(left, instances, moving, style)
    return {mine: places[yours] for mine, yours in agreement.partners.items()}


def _draw_labels(
    axes: Axes,
    xyz: Float[np.ndarray, "points 3"],
    labels: Panoptic,
    taken: dict[int, int],
    style: ClassStyle,
    reach: float,
) -> dict[int, int]:
    """Draw classes and instances; return the place of each instance's colour."""
    names, semantics = segments(labels, style.things).numpy(), labels.semantics.numpy()
    places = numbered(names, xyz, taken)
    _show(
        axes, xyz, paint(semantics, names, places, style.colours, style.things), np.isin(semantics, style.things), reach
    )
    return places


def _draw_errors(axes: Axes, xyz: Float[np.ndarray, "points 3"], agreement: Agreement, reach: float) -> None:
    verdicts = agreement.verdicts.numpy()
    palette = np.array([to_rgb(VERDICTS[verdict][1]) for verdict in Verdict])
    wrong = (verdicts == Verdict.WRONG_CLASS) | (verdicts == Verdict.WRONG_INSTANCE)
    _show(axes, xyz, palette[verdicts], wrong, reach)
    scored = max(int((verdicts != Verdict.NOT_SCORED).sum()), 1)
    name_panel(axes, "errors", f"{wrong.sum() / scored:.1%} of the points")
    handles = [Patch(color=colour, label=name) for name, colour in VERDICTS.values()]
    axes.legend(
        handles=handles,
        loc="lower left",
        fontsize=10,
        labelcolor=INK,
        facecolor=GROUND,
        edgecolor="none",
        framealpha=0.75,
    )


def _show(
    axes: Axes,
    xyz: Float[np.ndarray, "points 3"],
    colours: Float[np.ndarray, "points 3"],
    prominent: Bool[np.ndarray, "points"],
    reach: float,
) -> None:
    """Draw points, one pixel of the panel for one of the image."""
    image = rasterise(xyz, colours, prominent, reach, to_rgb(GROUND), round(PANEL * DPI))
    axes.imshow(image, extent=(reach, -reach, -reach, reach), interpolation="nearest", zorder=1)


def _draw_objects(
    axes: Axes, objects: Detections | Instances, moving: Bool[Tensor, "objects"], style: ClassStyle
) -> None:
    """Draw modal centres, extents as boxes, and arrows for those that are ``moving``."""
    objects, moving = objects.to("cpu"), moving.cpu()
    colours = [style.colour(one) for one in objects.classes.tolist()]
    centres, half_sizes = objects.centres[:, :2].numpy(), objects.extents[:, :2].numpy()
    yaws = [0.0] * len(centres) if objects.yaws is None else objects.yaws.rad2deg().tolist()
    boxes = [  # drawn over (y, x), where a turn from x to y is clockwise
        Rectangle((y - b, x - a), 2 * b, 2 * a, angle=-yaw, rotation_point="center")
        for (x, y), (a, b), yaw in zip(centres.tolist(), half_sizes.tolist(), yaws, strict=True)
    ]
    axes.add_collection(PatchCollection(boxes, facecolor="none", edgecolor=colours, linewidth=0.9, zorder=3))
    for one in objects.classes.unique().tolist():
        x, y = centres[(objects.classes == one).numpy()].T
        axes.plot(y, x, style.marker(one), color=style.colour(one), mec=GROUND, mew=0.7, ms=6, ls="", zorder=5)
    arrows = np.concatenate([centres, objects.velocities.numpy()], 1)[moving.numpy()]
    axes.quiver(
        arrows[:, 1], arrows[:, 0], arrows[:, 3], arrows[:, 2], color=INK, angles="xy", scale_units="xy", scale=1,
        width=0.004, zorder=4,
    )  # fmt: skip
