"""Labelled triangles that rays can be cast into."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Float, UInt32

from most.simulation.mesh import Mesh, merge
from most.simulation.surfaces import GLOSS, LABELS, REFLECTIVITY, Surface


@dataclass
class Hits:
    """What each ray met first; where it met nothing, the distance is infinite and the rest 0."""

    distance: Float[np.ndarray, "rays"]  # m
    label: UInt32[np.ndarray, "rays"]  # instance << 16 | raw class
    reflectivity: Float[np.ndarray, "rays"]  # share of the light that comes back at normal incidence
    cosine: Float[np.ndarray, "rays"]  # of the angle of incidence, in [0, 1]
    gloss: Float[
        np.ndarray, "rays"
    ]  # exponent of the cosine in the signal: 0.5 for what is matt, above 1 for what shines

    def nearer(self, other: "Hits") -> "Hits":
        """Per ray the nearer of two hits."""
        mine = self.distance <= other.distance
        return Hits(*(np.where(mine, a, b) for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))


class Scene:
    """Meshes with a label and a brightness each; the tree that rays walk is built once, here."""

    def __init__(self, meshes: Sequence[Mesh], labels: Sequence[int], gains: Sequence[float]) -> None:
        whole = merge(meshes)
        sizes = [len(mesh.faces) for mesh in meshes]
        own = np.repeat(np.asarray(labels, np.uint32), sizes)
        self._labels = np.where(own > 0, own, LABELS[whole.surfaces])
        dyed = np.isin(whole.surfaces, [Surface.PAINT, Surface.CLOTH, Surface.CARGO, Surface.WALL])
        gain = np.where(dyed, np.repeat(np.asarray(gains, np.float32), sizes), np.float32(1))
        self._reflectivity = REFLECTIVITY[whole.surfaces] * gain
        self._gloss = GLOSS[whole.surfaces]
        self._embree = EmbreeScene()
        self._mesh = TriangleMesh(self._embree, whole.vertices.astype(np.float32), whole.faces.astype(np.int32))

    def cast(self, origin: Float[np.ndarray, "3"], directions: Float[np.ndarray, "rays 3"]) -> Hits:
        """First hits of rays from one origin along unit directions, world frame."""
        way = np.ascontiguousarray(directions, np.float32)
        start = np.broadcast_to(np.asarray(origin, np.float32), way.shape).copy()
        found = self._embree.run(start, way, output=1)
        hit, face = found["primID"] >= 0, np.maximum(found["primID"], 0)
        normal = found["Ng"]
        size = np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
        cosine = np.abs((normal * way).sum(1)) / size
        return Hits(
            np.where(hit, found["tfar"], np.float32(np.inf)),
            np.where(hit, self._labels[face], np.uint32(0)),
            np.where(hit, self._reflectivity[face], np.float32(0)),
            np.where(hit, cosine, np.float32(0)),
            np.where(hit, self._gloss[face], np.float32(0)),
        )
