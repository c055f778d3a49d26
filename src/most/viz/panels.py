"""The frame of a bird's-eye view: square panels with metre axes, a heading and a legend, on a dark ground."""

from collections.abc import Mapping, Sequence

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.ticker import MultipleLocator

from most.viz.classes import ClassStyle
from most.viz.palette import FAINT, GROUND, INK, UNCLAIMED

DPI = 150
PANEL = 6.0  # inches, a side
LEFT, GAP, RIGHT, TOP, BOTTOM, ROW = 0.7, 0.15, 0.2, 0.9, 0.6, 0.27  # inches; ROW is a line of the legend
ENTRY = 1.5  # inches of the legend an entry takes
RING = 20  # m between circles about the sensor


def make_panels(
    count: int, title: str, figures: Mapping[str, float], legend: Sequence[Artist], reach: float
) -> tuple[Figure, list[Axes]]:
    """Return a figure of ``count`` empty panels that show ``reach`` metres about the sensor."""
    width = LEFT + count * PANEL + (count - 1) * GAP + RIGHT
    columns = int((width - LEFT) / ENTRY)
    bottom = BOTTOM + ROW * (-(-len(legend) // columns) + 0.5)
    height = TOP + PANEL + bottom
    figure = Figure((width, height), dpi=DPI, facecolor=GROUND)
    boxes = [((LEFT + i * (PANEL + GAP)) / width, bottom / height, PANEL / width, PANEL / height) for i in range(count)]
    axes = [_panel(figure, box, reach, first=i == 0) for i, box in enumerate(boxes)]
    figure.text(LEFT / width, 1 - 0.3 / height, title, color=INK, size=15, weight="bold", va="center")
    scores = "    ".join(f"{name} {value:.1%}" for name, value in figures.items())
    below = count == 1  # a narrow figure has no room beside the title
    at = (LEFT / width, 1 - 0.6 / height) if below else (1 - RIGHT / width, 1 - 0.3 / height)
    figure.text(*at, scores, color=INK, size=11 if below else 13, va="center", ha="left" if below else "right")
    figure.legend(
        handles=legend, loc="lower left", bbox_to_anchor=((LEFT - 0.1) / width, 0.05 / height), ncols=columns,
        frameon=False, labelcolor=INK, fontsize=10, handlelength=1.2, handletextpad=0.5, columnspacing=1.2,
    )  # fmt: skip
    return figure, axes


def _panel(figure: Figure, box: tuple[float, float, float, float], reach: float, first: bool) -> Axes:
    axes = figure.add_axes(box, facecolor=GROUND, xlim=(reach, -reach), ylim=(-reach, reach))
    axes.tick_params(colors=FAINT, labelsize=9, labelleft=first)
    axes.xaxis.set_major_locator(MultipleLocator(RING))
    axes.yaxis.set_major_locator(MultipleLocator(RING))
    for spine in axes.spines.values():
        spine.set_color("#30363d")
    axes.set_xlabel("left of the sensor, m", color=FAINT, size=10)
    if first:
        axes.set_ylabel("ahead of the sensor, m", color=FAINT, size=10)
    for radius in range(RING, int(reach) + 1, RING):
        axes.add_patch(Circle((0, 0), radius, fill=False, color=FAINT, alpha=0.35, lw=0.6, ls=(0, (4, 4)), zorder=2))
    axes.plot(0, 0, "^", color=INK, ms=7, mec=GROUND, zorder=6)
    return axes


def name_panel(axes: Axes, name: str, note: str = "") -> None:
    """Write a panel's name, and a note under it, into its upper left corner."""
    box = {"facecolor": GROUND, "edgecolor": "none", "alpha": 0.75, "pad": 3}
    axes.text(0.02, 0.975, name, color=INK, size=13, weight="bold", va="top", transform=axes.transAxes, bbox=box)
    if note:
        axes.text(0.02, 0.925, note, color=FAINT, size=10, va="top", transform=axes.transAxes, bbox=box)


def class_legend(seen: Sequence[int], style: ClassStyle) -> list[Artist]:
    """Return legend entries of the classes ``seen`` and of what else the panels draw."""
    things = [
        Line2D(
            [], [], marker=style.marker(one), color=style.colour(one), mec=GROUND, ms=9, ls="", label=style.names[one]
        )
        for one in seen
        if one in style.things
    ]
    stuff = [Patch(color=style.colour(one), label=style.names[one]) for one in seen if one not in style.things]
    marks = [
        Line2D([], [], marker="$\\rightarrow$", color=INK, ms=11, ls="", label="1 s of motion"),
        Line2D([], [], marker=".", color=UNCLAIMED, ms=8, ls="", label="no instance"),
    ]
    return [*things, *marks, *stuff]
