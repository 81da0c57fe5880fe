"""A picture in the making: what the passes have computed so far, and what that took."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.rendering.camera import Camera
from texbake.rendering.options import RenderOptions
from texbake.rendering.plan.effect import Target
from texbake.rendering.plan.plan import Plan
from texbake.rendering.plan.question import Question
from texbake.rendering.raster.world import World
from texbake.rendering.scene.lights import Light
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import Scene
from texbake.texture.image import FloatImage


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnObject:
    """An object in world space, as it is drawn.

    Attributes
    ----------
    mesh : Mesh
        What coordinates, normals and tangents are those of: the object's own mesh, placed.
    positions, faces
        Triangles that are drawn: the mesh's, or finer ones made from them.
    object_from_world : (4, 4) float64, optional
        Inverse of its transform; None where it has none.
    base_faces : (F,) int32, optional
        Face of `mesh` that each drawn one is a piece of; None where they are the same.
    base_weights : (F, 3, 2) float32, optional
        Place on that face of each corner of the piece, as weights of its second and third corner;
        exact, since they are halves of halves.
    normals, normal_faces : optional
        Shading normals of the drawn triangles where those are finer.
    """

    mesh: Mesh
    material: Material
    positions: FloatArray
    faces: IntArray
    object_from_world: FloatArray | None = None
    base_faces: IntArray | None = None
    base_weights: npt.NDArray[np.float32] | None = None
    normals: FloatArray | None = None
    normal_faces: IntArray | None = None

    @property
    def n_bytes(self) -> int:
        """Memory of finer triangles than the mesh's; those are counted by nobody else."""
        arrays = [self.base_faces, self.base_weights, self.normals]
        if self.base_faces is not None:
            arrays += [self.positions, self.faces]
        return sum(array.nbytes for array in arrays if array is not None)

    def on_base(
        self, faces: IntArray, weights: FloatArray, changes: npt.NDArray[np.float32]
    ) -> tuple[IntArray, FloatArray, npt.NDArray[np.float32]]:
        """Faces, weights and their changes of places on drawn triangles, told on `mesh`."""
        assert self.base_faces is not None and self.base_weights is not None
        base_weights, base_changes = np.empty_like(weights), np.empty_like(changes)
        _on_base_kernel(faces, weights, changes, self.base_weights, base_weights, base_changes)
        return self.base_faces[faces], base_weights, base_changes


@kernel
def _on_base_kernel(faces, weights, changes, corners, weights_out, changes_out):  # type: ignore[no-untyped-def]
    for i in range(len(faces)):
        piece = corners[faces[i]]
        for k in range(2):
            along = np.float64(piece[1, k] - piece[0, k])
            up = np.float64(piece[2, k] - piece[0, k])
            weights_out[i, k] = piece[0, k] + weights[i, 0] * along + weights[i, 1] * up
            if len(changes) > 0:
                changes_out[i, k] = changes[i, 0] * along + changes[i, 1] * up
                changes_out[i, 2 + k] = changes[i, 2] * along + changes[i, 3] * up


@dataclass
class PassCost:
    """What a pass took: seconds of all threads together, bytes that it keeps, and for how many."""

    seconds: float = 0.0
    n_bytes: int = 0
    skipped: str = ""


@dataclass(eq=False)
class Costs:
    """What the passes took, by the name of their effect."""

    by_name: dict[str, PassCost] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _running: threading.local = field(default_factory=threading.local)

    def add(self, name: str, seconds: float, n_bytes: int = 0) -> None:
        """Count some time and memory of a pass."""
        with self._lock:
            cost = self.by_name.setdefault(name, PassCost())
            cost.seconds += seconds
            cost.n_bytes += n_bytes

    def skip(self, name: str, why: str) -> None:
        """Note that a pass was not needed after all."""
        with self._lock:
            self.by_name.setdefault(name, PassCost()).skipped = why

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Count the time of a block, without that of blocks within it, which is theirs."""
        inner = getattr(self._running, "seconds", 0.0)
        self._running.seconds = 0.0
        start = time.perf_counter()
        try:
            yield
        finally:
            taken = time.perf_counter() - start
            self.add(name, taken - self._running.seconds)
            self._running.seconds = inner + taken


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """Everything that a pass may look at.

    Attributes
    ----------
    question : Question
        The scene, the options, the camera.
    plan : Plan
        Which effects are called for.
    values : dict
        (effect, target) to what its `load` or `prepare` returned.
    draw_others : callable
        (scene, cameras, options) to the colors, (H, W, 4), of pictures of a scene of the same
        objects: how an environment is rendered.
    """

    question: Question
    plan: Plan
    values: dict[tuple[str, Target], Any]
    costs: Costs
    threads: int | None
    draw_others: Callable[[Scene, Sequence[Camera], RenderOptions], list[FloatImage]]

    @property
    def scene(self) -> Scene:
        """What the picture is of."""
        return self.question.scene

    @property
    def options(self) -> RenderOptions:
        """The choices made for it."""
        return self.question.options

    @property
    def camera(self) -> Camera:
        """Where it is taken from."""
        return self.question.camera

    @property
    def lights(self) -> tuple[Light, ...]:
        """Lights of the scene."""
        return self.scene.lighting.lights

    def value(self, name: str, target: Target = None) -> Any:
        """What an effect computed for a target; None where it was not called for."""
        return self.values.get((name, target))

    def drawn(self, index: int) -> DrawnObject:
        """Return an object as it is drawn."""
        drawn: DrawnObject = self.values["placing", index]
        displaced: DrawnObject | None = self.value("displacement", index)
        return displaced or drawn

    @property
    def world(self) -> World:
        """All triangles."""
        world: World = self.values["world", None]
        return world

    @property
    def seen(self) -> frozenset[int]:
        """Objects that are in the picture, known once it is rasterized."""
        seen: frozenset[int] = self.values["seen objects", None]
        return seen
