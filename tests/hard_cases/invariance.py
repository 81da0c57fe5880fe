"""Changes of a mesh that change nothing about it, and how closely results agree after them.

What a command makes of the changed mesh is compared with what it makes of the mesh itself, with the
change applied to that result.
"""

import re
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from texbake import Mesh, TexbakeError
from texbake.mesh.frame import unit_scale

Array = npt.NDArray[np.float64]

# Kinds of changes, by what they may do to a result.
SCALE = "scale"  # by a power of two: no bit but exponents
PLACE = "exact shift"  # of a mesh on a grid, which no shift leaves: no bit relative to the mesh
TURN = "quarter turn"  # moves numbers from axis to axis: other orders of sums
FACES = "order of faces"
VERTICES = "order of vertices"
CORNERS = "order of corners"
KINDS = (SCALE, PLACE, TURN, FACES, VERTICES, CORNERS)

# Grid of the meshes that are shifted exactly, relative to their size: with a shift by 2^10 sizes,
# and a bit for the middle of the box, 53 bits hold every coordinate.
GRID = 2.0**-32

# Of sums of products in float64 that are added in another order, some tens of terms at most.
ROUNDING = 1e-13
# Of points that are computed and not copied: half a step of the coordinates of a mesh 2^11 sizes
# away, twice.
COMPUTED = 2.0**11 * 2.0**-52
FLOAT32 = 2.0**11 * 2.0**-23  # the same of single precision
VISIBLE = 2.0 / 255.0  # a difference of a color that shows

# Units of a quantity, in which its differences are measured:
NUMBER = "number"
COUNT = "count"  # relative to itself
LENGTH = "length"  # relative to the size of the mesh; so are the next three
AREA = "area"
CURVATURE = "curvature"
POINT = "point"
DIRECTION = "direction"
PICTURE = "picture"  # share of pixels that look different
POWERS = {LENGTH: 1, AREA: 2, CURVATURE: -1, POINT: 1}

# What its first axis counts.
WHOLE, FACE, VERTEX, CORNER = "whole", "face", "vertex", "corner"


@dataclass(frozen=True, kw_only=True)
class Change:
    """A change of one kind."""

    name: str
    kind: str
    scale: float = 1.0
    sizes: float = 0.0  # of the shift, in sizes of the mesh
    linear: tuple[tuple[int, int, int], ...] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


CHANGES: tuple[Change, ...] = (
    Change(name="2^-40", kind=SCALE, scale=2.0**-40),
    Change(name="2^-3", kind=SCALE, scale=2.0**-3), Change(name="2^50", kind=SCALE, scale=2.0**50),
    Change(name="by 2^4 sizes", kind=PLACE, sizes=2.0**4),
    Change(name="by 2^10 sizes", kind=PLACE, sizes=2.0**10),
    Change(name="about x", kind=TURN, linear=((1, 0, 0), (0, 0, -1), (0, 1, 0))),
    Change(name="about y", kind=TURN, linear=((0, 0, 1), (0, 1, 0), (-1, 0, 0))),
    Change(name="about z", kind=TURN, linear=((0, -1, 0), (1, 0, 0), (0, 0, 1))),
    Change(name="faces", kind=FACES), Change(name="vertices", kind=VERTICES),
    Change(name="corners", kind=CORNERS),
)  # fmt: skip


@dataclass(kw_only=True, eq=False)
class MeshPair:
    """A mesh before and after a change: ``after = scale * linear @ before + offset``.

    `faces`, `vertices` and `corners` say where each face, each vertex, and the first corner of each
    face was before.
    """

    change: Change
    before: Mesh
    after: Mesh
    faces: npt.NDArray[np.intp] = field(init=False)
    vertices: npt.NDArray[np.intp] = field(init=False)
    corners: npt.NDArray[np.intp] = field(init=False)
    scale: float = 1.0
    offset: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self):
        self.faces = np.arange(self.before.n_faces)
        self.vertices = np.arange(self.before.n_vertices)
        self.corners = np.zeros(self.before.n_faces, np.intp)

    @property
    def linear(self):
        return np.array(self.change.linear, float)

    def points(self, points):
        return np.asarray(points @ self.linear.T * self.scale + self.offset)


def size_of(mesh):
    """Longest side of the bounding box; 1 where it is a point."""
    low, high = mesh.bounds
    return float((high - low).max()) or 1.0


def changed(change, mesh):
    """Change a mesh."""
    if change.kind == SCALE:
        return _scaled(change, mesh)
    if change.kind == PLACE:
        return _placed(change, mesh)
    if change.kind == TURN:
        return _turned(change, mesh)
    pair = MeshPair(change=change, before=mesh, after=mesh)
    random = np.random.default_rng(6)
    if change.kind == VERTICES:
        pair.vertices = random.permutation(mesh.n_vertices)
        places = np.argsort(pair.vertices).astype(np.int32)
        pair.after = mesh.replace(positions=mesh.positions[pair.vertices], faces=places[mesh.faces])
    elif change.kind == FACES:
        pair.faces = random.permutation(mesh.n_faces)
        names = ("faces", "uv_faces", "normal_faces", "tangents", "face_groups")
        pair.after = _with(mesh, names, lambda values: values[pair.faces])
    else:
        pair.corners = random.integers(0, 3, mesh.n_faces)
        columns = (pair.corners[:, None] + np.arange(3)) % 3
        names = ("faces", "uv_faces", "normal_faces")
        pair.after = _with(mesh, names, lambda values: np.take_along_axis(values, columns, axis=1))
    return pair


def _with(mesh, names, function):
    """The mesh, with a function applied to those of the named arrays that it has."""
    fields = {name: getattr(mesh, name) for name in names}
    return mesh.replace(**{name: function(a) for name, a in fields.items() if a is not None})


def _scaled(change, mesh):
    scale = change.scale
    with np.errstate(over="ignore", under="ignore"):
        positions = mesh.positions * scale
        # Meshes at the ends of the range of float64 go the other way.
        if not (np.isfinite(positions).all() and np.array_equal(positions / scale, mesh.positions)):
            scale = 1.0 / scale
            positions = mesh.positions * scale
    return MeshPair(
        change=change, before=mesh, after=mesh.replace(positions=positions), scale=scale
    )


def _placed(change, mesh):
    scale = unit_scale(size_of(mesh))
    used = np.zeros(mesh.n_vertices, bool)
    used[mesh.faces] = True
    positions = mesh.positions.copy()
    step = GRID / scale
    with np.errstate(over="ignore"):
        on_grid = np.round(positions[used] / step) * step
    if step > 0.0 and np.isfinite(on_grid).all():
        positions[used] = on_grid
    # A power of two along each axis, other than those of the mesh.
    offset = np.array([1.0, -1.0, 0.5]) / scale * change.sizes
    before, after = (mesh.replace(positions=p) for p in (positions, positions + offset))
    exact = np.array_equal(after.positions[used] - offset, positions[used])
    assert exact, f"{mesh.name}: the shift is not exact"
    return MeshPair(change=change, before=before, after=after, offset=offset)


def _turned(change, mesh):
    linear = np.array(change.linear, float)
    with np.errstate(over="ignore"):
        after = _with(mesh, ("positions", "normals"), lambda vectors: vectors @ linear.T)
    return MeshPair(change=change, before=mesh, after=after)


@dataclass(frozen=True, kw_only=True, eq=False)
class Side:
    """A mesh before or after a change, and how it lies to the one before."""

    mesh: Mesh
    high: Mesh  # of the same faces, a little larger along each axis
    linear: Array
    middle: tuple[float, ...]  # of the box before the change, moved with the mesh
    size: float  # likewise

    def direction(self, vector):
        """A direction, turned with the mesh."""
        return tuple((np.asarray(vector, float) @ self.linear.T).tolist())

    def beside(self, way):
        """Point some sizes away from the middle, moved with the mesh."""
        return tuple((np.array(self.middle) + np.array(self.direction(way)) * self.size).tolist())


def sides(pair):
    """Both sides of a pair."""
    before, after = pair.before, pair.after
    low, high = before.bounds
    center = low / 2.0 + high / 2.0
    # By powers of two, so that a mesh on a grid stays on one.
    grown = (before.positions - center) * [1.0 + 2.0**-6, 1.0 + 2.0**-5, 1.0 - 2.0**-6] + center
    above = Mesh(positions=grown, faces=before.faces, name="high")
    moved = Mesh(positions=pair.points(grown)[pair.vertices], faces=after.faces, name="high")
    size, middle = size_of(before), pair.points(center)
    return (
        Side(mesh=before, high=above, linear=np.eye(3), middle=tuple(center.tolist()), size=size),
        Side(mesh=after, high=moved, linear=pair.linear, middle=tuple(middle.tolist()),
             size=size * pair.scale),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Quantity:
    """Numbers of a result, and by how much a change may change them, in units of their size.

    A bound of 0 stands for the same bits. None stands for no comparison: the result is another one,
    and only its properties hold. A scale by a power of two never changes any bit.

    Attributes
    ----------
    values : array
    unit, per : str
    place, turn, order : float or None
        Bounds of an exact shift, of a quarter turn, and of another order.
    """

    values: npt.NDArray[np.generic]
    unit: str = NUMBER
    per: str = WHOLE
    place: float | None = 0.0
    turn: float | None = None
    order: float | None = None

    def bound(self, kind):
        return {SCALE: 0.0, PLACE: self.place, TURN: self.turn}.get(kind, self.order)


def number(value, both=None, unit=NUMBER, **bounds):
    """One number, with one bound for turns and orders unless they have their own."""
    return Quantity(
        values=np.array(float(value)), unit=unit, **{"turn": both, "order": both, **bounds}
    )


def fixed(**values):
    return {
        name: Quantity(values=np.asarray(value), turn=0.0, order=0.0)
        for name, value in values.items()
    }


def outcome(command, side):
    """Result of a command, or its error, without the numbers in it."""
    try:
        return command(side)
    except TexbakeError as error:
        assert "\n" not in str(error)
        return f"{type(error).__name__}: {re.sub(r'[-+]?[0-9][-+0-9.,e]*', '#', str(error))}"


def faults(before, after, pair):
    """Differences between two outcomes that exceed their bounds."""
    if isinstance(before, str) or isinstance(after, str):
        refused = [x if isinstance(x, str) else "a result" for x in (before, after)]
        return [] if before == after else [f"refused by one: {' | '.join(refused)}"]
    assert before.keys() == after.keys()
    kind = pair.change.kind
    differences = {
        name: _difference(one, after[name].values, pair)
        for name, one in before.items()
        if one.bound(kind) is not None
    }
    return [
        f"{name} differs by {difference:.3g}, and may by {before[name].bound(kind):.3g}"
        for name, difference in differences.items()
        if difference > before[name].bound(kind)
    ]


def _difference(quantity, after, pair):
    """By how much values differ after a change, in units of their size; 0 for the same bits."""
    expected = _expected(quantity, pair)
    if expected.shape != after.shape:
        return np.inf
    is_float = expected.dtype.kind == "f"
    if np.array_equal(expected, after, equal_nan=is_float):
        return 0.0
    if expected.dtype.kind == "U":
        return np.inf
    a, b = np.asarray(expected, float), np.asarray(after, float)
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.where((a == b) | (np.isnan(a) & np.isnan(b)), 0.0, np.abs(a - b))
    if is_float:
        # Lengths at the end of the range have few bits: two of its steps are none.
        step = 2.0 * float(np.finfo(quantity.values.dtype).smallest_subnormal)
        apart[apart <= step * max(1.0, pair.scale)] = 0.0
    if not apart.any():
        return 0.0
    greatest = np.inf if np.isnan(apart).any() else float(apart.max())
    if quantity.unit == PICTURE:
        differs = ~(apart <= VISIBLE)
        greatest = float(differs.reshape(*differs.shape[:2], -1).any(axis=2).mean())
    elif quantity.unit in POWERS:
        with np.errstate(all="ignore"):
            size = np.float64(size_of(pair.before) * pair.scale)
            greatest /= float(size ** POWERS[quantity.unit]) or 1.0
    elif quantity.unit == COUNT:
        greatest /= float(np.abs(a).max(initial=1.0))
    return max(greatest, np.finfo(float).tiny)  # a difference of any size is not 0


def _expected(quantity, pair):
    """Values before a change as they are after it."""
    values = quantity.values
    if quantity.unit == POINT:
        values = pair.points(values)
    elif quantity.unit == DIRECTION:
        values = np.asarray(values @ pair.linear.T).astype(values.dtype)
    elif quantity.unit in POWERS:
        with np.errstate(over="ignore", under="ignore"):
            values = values * np.asarray(pair.scale, values.dtype) ** POWERS[quantity.unit]
    if quantity.per == VERTEX:
        values = values[pair.vertices]
    elif quantity.per in (FACE, CORNER):
        values = values[pair.faces]
    if quantity.per == CORNER:
        columns = (pair.corners[:, None] + np.arange(3)) % 3
        ones = [1] * (values.ndim - 2)
        values = np.take_along_axis(values, columns.reshape(-1, 3, *ones), axis=1)
    return values
