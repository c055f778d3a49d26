"""A rerun recording of a sequence: what the viewer shows, and how it is laid out. Needs the extra ``viz``.

The trees ``prediction`` and ``truth`` are alike. Their root is the world; ``sensor`` below it has the sensor's pose,
and in its frame lie ``stuff`` and ``things`` (points by class), ``tracks`` (the things again, by identity), ``boxes``
and ``velocities`` (an arrow is a second of motion). Timelines: ``scan`` (number in the sequence), ``time``.
"""

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor

from most.errors import DataError
from most.structures import Panoptic
from most.viz.classes import ClassStyle
from most.viz.identities import Identities
from most.viz.objects import Objects

PROMINENT = rr.Radius.ui_points(2.5)  # of points of things


class Recording:
    """Writes to a file what is shown at each scan; ``close`` ends it, ``check_whole`` then looks for the end."""

    def __init__(self, path: Path, name: str, style: ClassStyle, trees: list[str]) -> None:
        """``trees`` are shown side by side."""
        rr.set_strict_mode(True)  # else a mistake is a line in a log, and the file lacks what was meant
        self.path, self.style = path, style
        self._stream = rr.RecordingStream("most")
        self._stream.set_log_tick_enabled(False)
        self._stream.set_log_time_enabled(False)
        self._stream.save(path, default_blueprint=layout(trees))
        self._stream.send_recording_name(name)
        self._stream.log("/", annotations(style), static=True)
        for tree in trees:
            self._stream.log(tree, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def at(self, index: int, seconds: float) -> None:
        """Say when what follows is shown: the scan's number, and its time since the first scan shown."""
        self._stream.set_time("scan", sequence=index)
        self._stream.set_time("time", duration=seconds)

    def sensor(self, tree: str, pose: Float64[Tensor, "4 4"]) -> None:
        """Place the sensor in the world."""
        where = rr.Transform3D(translation=pose[:3, 3].numpy(), mat3x3=pose[:3, :3].numpy())
        self._stream.log(f"{tree}/sensor", where)

    def points(
        self,
        tree: str,
        xyz: Float[Tensor, "points 3"],
        labels: Panoptic,
        segments: Int64[Tensor, "points"],
        identities: Identities,
    ) -> None:
        """Show the finite ones of a scan's points (m, sensor)."""
        finite = xyz.isfinite().all(1)
        things = torch.isin(labels.semantics, torch.tensor(self.style.things)) & finite
        classes = labels.semantics.numpy().astype(np.uint16)
        for name, chosen in {"stuff": ~things & finite, "things": things}.items():
            radii = PROMINENT if name == "things" else None
            cloud = rr.Points3D(xyz[chosen].numpy(), class_ids=classes[chosen.numpy()], radii=radii)
            self._stream.log(f"{tree}/sensor/{name}", cloud)
        colours = identities.colours(segments[things])
        self._stream.log(f"{tree}/sensor/tracks", rr.Points3D(xyz[things].numpy(), colors=colours, radii=PROMINENT))

    def objects(self, tree: str, objects: Objects, identities: Identities) -> None:
        """Show a scan's objects (m, sensor): all their boxes, and arrows for those that move."""
        colours, centres = identities.colours(objects.segments), objects.centres.numpy()
        names = [self._name(*pair) for pair in zip(objects.classes.tolist(), objects.segments.tolist(), strict=True)]
        boxes = rr.Boxes3D(
            centers=centres,
            half_sizes=objects.half_sizes.numpy(),
            quaternions=None if objects.yaws is None else quaternions(objects.yaws),
            colors=colours,
            labels=names,
            show_labels=False,
        )
        self._stream.log(f"{tree}/sensor/boxes", boxes)
        moving = objects.moving.numpy()
        vectors = np.pad(objects.velocities.numpy()[moving], ((0, 0), (0, 1)))
        arrows = rr.Arrows3D(vectors=vectors, origins=centres[moving], colors=colours[moving])
        self._stream.log(f"{tree}/sensor/velocities", arrows)

    def close(self) -> None:
        """Write what is still held back, and the file's end."""
        self._stream.disconnect()

    def check_whole(self) -> None:
        """Raise a DataError for a file without its end: a full disk stops the library's writing, not the program."""
        try:
            rr.chunk.RrdReader(self.path).store()
        except Exception as error:
            raise DataError(
                f"{self.path.parent}: expected room for a whole recording, found it cut off ({error}); make "
                "room, or choose fewer scans: first=... last=..."
            ) from error

    def _name(self, class_id: int, segment: int) -> str:
        return f"{self.style.names[class_id]} {segment & 0xFFFFFFFF}" if segment else self.style.names[class_id]


def quaternions(yaws: Float[Tensor, "objects"]) -> Float[np.ndarray, "objects 4"]:
    """Return turns about z as x, y, z, w."""
    zero, half = torch.zeros_like(yaws), yaws / 2
    return torch.stack([zero, zero, half.sin(), half.cos()], 1).numpy()


def annotations(style: ClassStyle) -> rr.AnnotationContext:
    """Names and colours of the classes."""
    rows = []
    for class_id, name in enumerate(style.names):
        red, green, blue = (round(255 * part) for part in style.colour(class_id))
        rows.append(rr.AnnotationInfo(id=class_id, label=name, color=(red, green, blue)))
    return rr.AnnotationContext(rows)


def layout(trees: list[str]) -> rrb.Blueprint:
    """The trees side by side, by track and, under another tab, by class; the eye goes with the sensor."""
    tabs = {"by track": "things", "by class": "tracks"}  # and what each leaves out
    shown = [
        rrb.Horizontal(*(_view(tree, f"{tree} {name}", hidden) for tree in trees), name=name)
        for name, hidden in tabs.items()
    ]
    return rrb.Blueprint(rrb.Tabs(*shown), rrb.TimePanel(state="expanded", timeline="time"), collapse_panels=True)


def _view(tree: str, name: str, hidden: str) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin=f"/{tree}",
        name=name,
        contents=["+ $origin/**", f"- $origin/sensor/{hidden}"],
        eye_controls=rrb.EyeControls3D(tracking_entity=f"/{tree}/sensor"),
    )
