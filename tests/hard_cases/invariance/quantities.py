"""What a command gives, number by number, and how closely it agrees after a change."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from invariance.changes import (
    KINDS,
    PLACE,
    SCALE,
    Array,
    Changed,
    size_of,
)

from texbake import Mesh, TexbakeError
from texbake.mesh.normals import degenerate_faces

# Units of a quantity, in which its differences are measured:
NUMBER = "number"
COUNT = "count"  # relative to itself
LENGTH = "length"  # relative to the size of the mesh; so are the next three
AREA = "area"
CURVATURE = "curvature"
POINT = "point"
DIRECTION = "direction"
PICTURE = "picture"  # share of pixels that look different
UNIT_POWERS = {LENGTH: 1, AREA: 2, CURVATURE: -1, POINT: 1}

# What its first axis counts.
WHOLE, FACE, VERTEX, CORNER = "whole", "face", "vertex", "corner"

# A difference of a color that shows.
VISIBLE = 2.0 / 255.0


# Of sums of products in float64 that are added in another order, some tens of terms at most.
ROUNDING = 1e-13

Bounds = Mapping[str, float | None]

# Nothing changes any bit.
SAME: Bounds = dict.fromkeys(KINDS, 0.0)
# Powers of two and exact shifts change no bit; after other changes the result is another one.
EXACT: Bounds = {SCALE: 0.0, PLACE: 0.0}
# The same for points that are computed and not copied: they are rounded where the mesh is. Half a
# step of the coordinates of a mesh 2^11 sizes away, twice.
MADE: Bounds = {SCALE: 0.0, PLACE: 2.0**11 * 2.0**-52}


def within(others: float, **kinds: float | None) -> Bounds:
    """EXACT, and one bound for all other kinds of changes but those with one of their own."""
    named = {kind.replace("_", " "): bound for kind, bound in kinds.items()}
    assert named.keys() <= set(KINDS)
    return {**dict.fromkeys(KINDS, others), **EXACT, **named}


@dataclass(frozen=True, kw_only=True, eq=False)
class Quantity:
    """Numbers of a result.

    Attributes
    ----------
    values : array
    unit, per : str
    bounds : mapping of kinds of changes to float
        Greatest difference, in units of its size; 0 for the same bits. Kinds that are not named are
        not compared: the result is another one, and only its properties hold.
    amplified : float
        Times the rounding of positions, relative to the least height of a face, by which it may
        differ besides: a vertex that moves by d turns a face of height h by d / h.
    """

    values: npt.NDArray[np.generic]
    unit: str = NUMBER
    per: str = WHOLE
    bounds: Bounds
    amplified: float = 0.0


def counts(**values: object) -> dict[str, Quantity]:
    """Whole numbers that nothing changes."""
    return {name: Quantity(values=np.asarray(value), bounds=SAME) for name, value in values.items()}


def number(value: float, bounds: Bounds, unit: str = NUMBER, *, amplified: float = 0.0) -> Quantity:
    """One number."""
    return Quantity(values=np.array(float(value)), unit=unit, bounds=bounds, amplified=amplified)


def points_made(mesh: Mesh) -> dict[str, Quantity]:
    """The faces and positions of a mesh that a command has made."""
    return {
        "faces": Quantity(values=mesh.faces, bounds=EXACT),
        "positions": Quantity(values=mesh.positions, unit=POINT, bounds=MADE),
    }


@dataclass(frozen=True)
class Refusal:
    """An error of one line, without the numbers in it."""

    message: str

    @classmethod
    def of(cls, error: TexbakeError) -> Refusal:
        """Refusal by an error."""
        assert "\n" not in str(error)
        return cls(f"{type(error).__name__}: {re.sub(r'[-+]?[0-9][-+0-9.,e]*', '#', str(error))}")


Outcome = Mapping[str, Quantity] | Refusal


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How a quantity agrees.

    `difference` is in the unit of the quantity; infinite where shapes differ. `bound` is None where
    it is not compared.
    """

    name: str
    difference: float
    bound: float | None
    is_same: bool

    @property
    def holds(self) -> bool:
        """Whether the difference is within its bound."""
        return self.bound is None or (
            self.is_same if self.bound == 0 else self.difference <= self.bound
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Side:
    """A mesh before or after a change, and how it lies to the one before."""

    mesh: Mesh
    high: Mesh  # of the same faces, a little larger along each axis
    scale: float
    linear: Array
    offset: Array
    middle: tuple[float, ...]  # of the box before the change, moved with the mesh
    size: float  # likewise

    def direction(self, vector: npt.ArrayLike) -> tuple[float, ...]:
        """A direction, turned with the mesh."""
        return tuple((np.asarray(vector, float) @ self.linear.T).tolist())

    def beside(self, way: npt.ArrayLike) -> tuple[float, ...]:
        """Point some sizes away from the middle, moved with the mesh."""
        return tuple((np.array(self.middle) + np.array(self.direction(way)) * self.size).tolist())


def sides(changed: Changed) -> tuple[Side, Side]:
    """Both sides of a change."""
    before = changed.before
    low, high = before.bounds
    center = low / 2.0 + high / 2.0
    # By powers of two, so that a mesh on a grid stays on one.
    grown = (before.positions - center) * [1.0 + 2.0**-6, 1.0 + 2.0**-5, 1.0 - 2.0**-6] + center
    above = Mesh(positions=grown, faces=before.faces, name="high")
    after = Mesh(
        positions=changed.points(grown)[changed.vertices], faces=changed.after.faces, name="high"
    )
    size = size_of(before)
    moved = changed.points(center)
    return (
        Side(mesh=before, high=above, scale=1.0, linear=np.eye(3), offset=np.zeros(3),
             middle=tuple(center.tolist()), size=size),
        Side(mesh=changed.after, high=after, scale=changed.scale, linear=changed.linear,
             offset=changed.offset, middle=tuple(moved.tolist()), size=size * changed.scale),
    )  # fmt: skip


def outcome(command: Callable[[Side], Mapping[str, Quantity]], side: Side) -> Outcome:
    """What a command gives, or why it refuses."""
    try:
        return command(side)
    except TexbakeError as error:
        return Refusal.of(error)


def least_height(mesh: Mesh) -> float:
    """Least height of a face, relative to the size of the mesh; 0 where one has no area."""
    if degenerate_faces(mesh).any():
        return 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        corners = mesh.positions[mesh.faces] / size_of(mesh)
        edges = np.roll(corners, -1, axis=1) - corners
        areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        return float((areas / np.linalg.norm(edges, axis=2).max(axis=1)).min())


def compared(before: Outcome, after: Outcome, changed: Changed) -> list[Agreement]:
    """How two outcomes agree; both of them are results."""
    assert not isinstance(before, Refusal) and not isinstance(after, Refusal)
    assert before.keys() == after.keys()
    return [_agreement(name, before[name], after[name], changed) for name in before]


def _agreement(name: str, before: Quantity, after: Quantity, changed: Changed) -> Agreement:
    bound = before.bounds.get(changed.change.kind)
    if bound is not None and changed.rounding:
        height = least_height(changed.before)
        # Where rounding turns faces over, nothing is compared.
        is_steady = height > 2.0**20 * changed.rounding
        bound = bound + before.amplified * changed.rounding / height if is_steady else None
    if before.values.shape != after.values.shape:
        return Agreement(name=name, difference=np.inf, bound=bound, is_same=False)
    expected = _expected(before, changed)
    found = after.values
    is_same = np.array_equal(expected, found, equal_nan=expected.dtype.kind == "f")
    if not is_same and expected.dtype.kind == "f":
        # Lengths at the end of the range have few bits: two of its steps are none.
        step = 2.0 * float(np.finfo(before.values.dtype).smallest_subnormal)
        with np.errstate(invalid="ignore", over="ignore"):
            near = np.abs(expected - found) <= step * max(1.0, changed.scale)
            is_same = bool(np.all((expected == found) | near))
    difference = 0.0 if is_same else _difference(before.unit, expected, found, changed)
    return Agreement(name=name, difference=difference, bound=bound, is_same=is_same)


def _expected(quantity: Quantity, changed: Changed) -> npt.NDArray[np.generic]:
    """Values before a change as they are after it."""
    values = quantity.values
    if quantity.unit in UNIT_POWERS and quantity.unit != POINT:
        with np.errstate(over="ignore", under="ignore"):
            values = values * np.asarray(changed.scale, values.dtype) ** UNIT_POWERS[quantity.unit]
    elif quantity.unit == POINT:
        values = changed.points(values)
    elif quantity.unit == DIRECTION:
        values = np.asarray(changed.direction(values)).astype(values.dtype)
    if quantity.per == VERTEX:
        values = values[changed.vertices]
    elif quantity.per in (FACE, CORNER):
        values = values[changed.faces]
    if quantity.per == CORNER:
        columns = (changed.corners[:, None] + np.arange(3)) % 3
        if np.linalg.det(changed.linear) < 0.0:
            columns = columns[:, ::-1]
        values = np.take_along_axis(
            values, columns.reshape(-1, 3, *[1] * (values.ndim - 2)), axis=1
        )
    return values


def _difference(
    unit: str, expected: npt.NDArray[np.generic], found: npt.NDArray[np.generic], changed: Changed
) -> float:
    if expected.dtype.kind == "U":
        return np.inf
    a, b = np.asarray(expected, float), np.asarray(found, float)
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.where((a == b) | (np.isnan(a) & np.isnan(b)), 0.0, np.abs(a - b))
    if unit == PICTURE:
        differs = ~(apart <= VISIBLE)
        return float(differs.reshape(differs.shape[0], differs.shape[1], -1).any(axis=2).mean())
    greatest = float(np.max(apart, initial=0.0)) if not np.isnan(apart).any() else np.inf
    if unit in UNIT_POWERS:
        with np.errstate(all="ignore"):
            size = np.float64(size_of(changed.before) * changed.scale)
            greatest /= float(size ** UNIT_POWERS[unit]) or 1.0
    elif unit == COUNT:
        greatest /= float(np.abs(a).max(initial=1.0))
    return greatest
