"""Changes of a mesh that change nothing about it: its size, place, direction and order.

What a command makes of the changed mesh is compared with what it makes of the mesh itself, with the
change applied to that result.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from texbake import Mesh
from texbake.mesh.frame import unit_scale

Array = npt.NDArray[np.float64]

# Kinds of changes, by what they may do to a result.
SCALE = "scale"  # by a power of two: no bit but exponents
PLACE = "exact shift"  # of a mesh on a grid, which no shift leaves: no bit relative to the mesh
SHIFT = "shift"  # rounds every position
QUARTER = "quarter turn"  # moves numbers from axis to axis: other orders of sums
MIRROR = "mirror"
TURN = "turn"  # by any angle: rounds every position
FACES = "order of faces"
VERTICES = "order of vertices"
CORNERS = "order of corners"
KINDS = (SCALE, PLACE, SHIFT, QUARTER, MIRROR, TURN, FACES, VERTICES, CORNERS)
ORDERS = (FACES, VERTICES, CORNERS)

# Grid of the meshes that are shifted exactly, relative to their size: with a shift by 2^10 sizes,
# and a bit for the middle of the box, 53 bits hold every coordinate.
GRID = 2.0**-32


@dataclass(frozen=True, kw_only=True)
class Change:
    """A change of one kind."""

    name: str
    kind: str
    scale: float = 1.0
    sizes: float = 0.0  # of the shift, in sizes of the mesh
    linear: tuple[tuple[float, float, float], ...] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))

    def applied(self, mesh: Mesh) -> Changed:
        """Mesh to compare with, and what has become of it."""
        return _CHANGERS[self.kind](self, mesh)


@dataclass(frozen=True, kw_only=True, eq=False)
class Changed:
    """A mesh before and after a change.

    Attributes
    ----------
    change : Change
    before, after : Mesh
    scale, linear, offset
        ``after = scale * linear @ before + offset``.
    faces : (F,) int
        Place of each face after the change in the list before it.
    vertices : (V,) int
        The same for vertices.
    corners : (F,) int
        Corner before the change that is the first one after it.
    rounding : float
        How far positions may have moved by rounding, relative to the size of the mesh.
    """

    change: Change
    before: Mesh
    after: Mesh
    faces: npt.NDArray[np.intp]
    vertices: npt.NDArray[np.intp]
    corners: npt.NDArray[np.intp]
    scale: float = 1.0
    linear: Array = field(default_factory=lambda: np.eye(3))
    offset: Array = field(default_factory=lambda: np.zeros(3))
    rounding: float = 0.0

    def direction(self, vectors: Array) -> Array:
        """Vectors before the change as they are after it."""
        return np.asarray(vectors @ self.linear.T)

    def points(self, points: Array) -> Array:
        """Points before the change as they are after it."""
        return np.asarray(self.direction(points) * self.scale + self.offset)


def size_of(mesh: Mesh) -> float:
    """Longest side of the bounding box; 1 where it is a point."""
    low, high = mesh.bounds
    return float((high - low).max()) or 1.0


def _identity(mesh: Mesh) -> dict[str, npt.NDArray[np.intp]]:
    return {
        "faces": np.arange(mesh.n_faces),
        "vertices": np.arange(mesh.n_vertices),
        "corners": np.zeros(mesh.n_faces, np.intp),
    }


def _scaled(change: Change, mesh: Mesh) -> Changed:
    scale = change.scale
    with np.errstate(over="ignore", under="ignore"):
        positions = mesh.positions * scale
        # Meshes at the ends of the range of float64 go the other way.
        if not (np.isfinite(positions).all() and np.array_equal(positions / scale, mesh.positions)):
            scale = 1.0 / scale
            positions = mesh.positions * scale
    after = mesh.replace(positions=positions)
    return Changed(change=change, before=mesh, after=after, scale=scale, **_identity(mesh))


def _shift(change: Change, mesh: Mesh) -> Array:
    """A power of two along each axis, other than those of the mesh."""
    size = 1.0 / unit_scale(size_of(mesh))
    return np.array([1.0, -1.0, 0.5]) * size * change.sizes


def _placed(change: Change, mesh: Mesh) -> Changed:
    step = GRID / unit_scale(size_of(mesh))
    used = np.zeros(mesh.n_vertices, bool)
    used[mesh.faces] = True
    positions = mesh.positions.copy()
    with np.errstate(over="ignore"):
        on_grid = np.round(positions[used] / step) * step
    if step > 0.0 and np.isfinite(on_grid).all():
        positions[used] = on_grid
    before = mesh.replace(positions=positions)
    offset = _shift(change, mesh)
    after = before.replace(positions=positions + offset)
    exact = np.array_equal(after.positions[used] - offset, positions[used])
    assert exact, f"{mesh.name}: the shift is not exact"
    return Changed(change=change, before=before, after=after, offset=offset, **_identity(mesh))


def _shifted(change: Change, mesh: Mesh) -> Changed:
    offset = _shift(change, mesh) * (1.0 + 0.1234567)
    after = mesh.replace(positions=mesh.positions + offset)
    return Changed(
        change=change, before=mesh, after=after, offset=offset, rounding=_rounding(after),
        **_identity(mesh),
    )  # fmt: skip


def _rounding(mesh: Mesh) -> float:
    """Half a step of the farthest coordinate, relative to the size of the mesh."""
    return float(np.spacing(np.abs(mesh.bounds).max()) / 2.0 / size_of(mesh))


def _turned(change: Change, mesh: Mesh) -> Changed:
    linear = np.array(change.linear, float)
    places = _identity(mesh)
    with np.errstate(over="ignore"):
        after = mesh.replace(positions=mesh.positions @ linear.T)
    if mesh.normals is not None:
        after = after.replace(normals=mesh.normals @ linear.T)
    if np.linalg.det(linear) < 0.0:  # the first and the last corner change places
        fields = {
            name: getattr(mesh, name)[:, ::-1]
            for name in ("faces", "uv_faces", "normal_faces")
            if getattr(mesh, name) is not None
        }
        if mesh.uvs is not None:
            fields["uvs"] = mesh.uvs * [-1.0, 1.0] + [1.0, 0.0]
        after = after.replace(**fields)
    rounding = 4.0 * max(_rounding(mesh), _rounding(after)) if change.kind == TURN else 0.0
    return Changed(
        change=change, before=mesh, after=after, linear=linear, rounding=rounding, **places
    )


def _faces_reordered(change: Change, mesh: Mesh) -> Changed:
    order = np.random.default_rng(6).permutation(mesh.n_faces)
    names = ("faces", "uv_faces", "normal_faces", "tangents", "face_groups")
    fields = {n: getattr(mesh, n)[order] for n in names if getattr(mesh, n) is not None}
    after = mesh.replace(**fields)
    return Changed(change=change, before=mesh, after=after, **{**_identity(mesh), "faces": order})


def _vertices_renumbered(change: Change, mesh: Mesh) -> Changed:
    order = np.random.default_rng(5).permutation(mesh.n_vertices)
    places = np.argsort(order).astype(np.int32)
    after = mesh.replace(positions=mesh.positions[order], faces=places[mesh.faces])
    return Changed(
        change=change, before=mesh, after=after, **{**_identity(mesh), "vertices": order}
    )


def _corners_rotated(change: Change, mesh: Mesh) -> Changed:
    firsts = np.random.default_rng(7).integers(0, 3, mesh.n_faces)
    columns = (firsts[:, None] + np.arange(3)) % 3
    names = ("faces", "uv_faces", "normal_faces")
    fields = {
        n: np.take_along_axis(getattr(mesh, n), columns, axis=1)
        for n in names
        if getattr(mesh, n) is not None
    }
    after = mesh.replace(**fields)
    return Changed(
        change=change, before=mesh, after=after, **{**_identity(mesh), "corners": firsts}
    )


_CHANGERS: dict[str, Callable[[Change, Mesh], Changed]] = {
    SCALE: _scaled,
    PLACE: _placed,
    SHIFT: _shifted,
    QUARTER: _turned,
    MIRROR: _turned,
    TURN: _turned,
    FACES: _faces_reordered,
    VERTICES: _vertices_renumbered,
    CORNERS: _corners_rotated,
}


def _general() -> tuple[tuple[float, float, float], ...]:
    """A rotation about no axis of the space, by no part of a full turn."""
    a, b, c, d = np.array([0.8, 0.3, -0.4, 0.2]) / np.linalg.norm([0.8, 0.3, -0.4, 0.2])
    return (
        (a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)),
        (2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)),
        (2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d),
    )


CHANGES: tuple[Change, ...] = (
    Change(name="2^-40", kind=SCALE, scale=2.0**-40),
    Change(name="2^-3", kind=SCALE, scale=2.0**-3),
    Change(name="2^20", kind=SCALE, scale=2.0**20),
    Change(name="2^50", kind=SCALE, scale=2.0**50),
    Change(name="exactly by 2^4 sizes", kind=PLACE, sizes=2.0**4),
    Change(name="exactly by 2^10 sizes", kind=PLACE, sizes=2.0**10),
    Change(name="by 18 sizes", kind=SHIFT, sizes=2.0**4),
    Change(name="by 1150 sizes", kind=SHIFT, sizes=2.0**10),
    Change(name="about x", kind=QUARTER, linear=((1, 0, 0), (0, 0, -1), (0, 1, 0))),
    Change(name="about y", kind=QUARTER, linear=((0, 0, 1), (0, 1, 0), (-1, 0, 0))),
    Change(name="about z", kind=QUARTER, linear=((0, -1, 0), (1, 0, 0), (0, 0, 1))),
    Change(name="in x", kind=MIRROR, linear=((-1, 0, 0), (0, 1, 0), (0, 0, 1))),
    Change(name="by any angle", kind=TURN, linear=_general()),
    Change(name="faces", kind=FACES),
    Change(name="vertices", kind=VERTICES),
    Change(name="corners", kind=CORNERS),
)
