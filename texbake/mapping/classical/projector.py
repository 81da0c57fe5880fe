"""Projector mapping: an image cast onto the mesh as by a slide projector.

A 4 x 4 matrix M gives (s, t, r, q) = M P, and the texture coordinates are s / q and t / q. With
q = 1 everywhere the rays are parallel. docs/explanation/mappings.md says what becomes of faces that
the projector does not see. The camera is that of previews (`texbake.rendering.camera`), so that an
image of a preview lands where it was taken: the default distance, 1.03 R / sin(fov / 2), fits the
sphere of radius R about the center of the bounding box into the image, which fills the unit square.

Based on: Segal, Korobkin, van Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using
texture mapping", SIGGRAPH 1992 (projective textures). It departs in deciding what is in shadow by
rays, face by face, instead of by a depth map, pixel by pixel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.errors import FileFormatError, OptionError, counted
from texbake.files import PathLike
from texbake.mapping.corner_uvs import Projected
from texbake.mesh.files.source import parse_row, read_lines
from texbake.mesh.frame import LocalFrame, unit_scale
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh, frozen
from texbake.mesh.triangle_tree import TriangleTree
from texbake.parallel import run_bands

if TYPE_CHECKING:
    from texbake.mapping.options import UnwrapOptions
    from texbake.mapping.options.shared import Matrix


# Margin around the bounding sphere, as in previews.
_MARGIN = 1.03

# As a share of the greatest |q|: a point with a smaller q counts as behind the projector, and is
# divided by this much instead, so that every coordinate is finite.
_LEAST_Q = 2.0**-20

# Rows of unit length that are this close to linearly dependent count as dependent: matrices are
# written with six digits or more, and the image would be a line.
_DEPENDENT = 1e-9

# Rounding of the null vector of such rows. A projector farther away than the inverse of this, in
# sizes of the mesh, is at infinity.
_AT_INFINITY = 1e-13

# Cosine between the normal of a face and a ray that rounding leaves of one that passes along it.
_ALONG = 2.0**-48

_BAND = 1 << 12

# Barycentric coordinates of the four samples of a face: its centroid, and the midpoints between the
# centroid and the corners. All lie inside the face, where no neighbor touches it.
_SAMPLES = frozen(np.array([[2, 2, 2], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6.0)


def _camera_rows(
    mesh: Mesh,
    camera: tuple[float, float] | tuple[float, float, float | None] | None,
    fov: float,
    local: LocalFrame,
) -> tuple[FloatArray, FloatArray]:
    """(4, 3) rows of the matrix, and (3,) the local way from the center to the camera."""
    azimuth, elevation, *rest = camera or (0.0, 0.0)
    assert azimuth is not None and elevation is not None
    sin_a, cos_a = pm.sin(math.radians(azimuth)), pm.cos(math.radians(azimuth))
    sin_e, cos_e = pm.sin(math.radians(elevation)), pm.cos(math.radians(elevation))
    right, back = np.array([(cos_a, 0.0, -sin_a), (sin_a * cos_e, sin_e, cos_a * cos_e)])
    up = np.cross(back, right)
    given = rest[0] if rest else None
    half = math.radians(fov) / 2.0
    if given is None:
        # That of the sphere about the center of the bounding box; 1 for a mesh without extent.
        own = LocalFrame.around(mesh)
        points = own.to_local(mesh.positions[mesh.faces.ravel()])
        radius = math.sqrt(float(pm.vecdot(points, points).max()))
        radius = radius * (local.scale / own.scale) if radius > 0.0 else local.scale
        distance = _MARGIN * radius / pm.sin(half)
    else:
        distance = given * local.scale
    focal = 1.0 / pm.tan(half)
    rows = np.stack([0.5 * (focal * right - back), 0.5 * (focal * up - back), -back, -back])
    return rows, distance * back


def projector(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Project the unit square of the texture onto a mesh."""
    local = LocalFrame.around(mesh)
    matrix = projector_matrix(mesh, options, local)
    seen_from = seen_from_of(matrix)
    used = mesh.used_vertices
    positions = np.zeros((mesh.n_vertices, 3))
    positions[used] = local.to_local(mesh.positions[used])

    corners, behind = _cast(positions, mesh.faces, used, matrix)
    away = ~behind & ~_turned_to(positions, mesh.faces, seen_from)
    facing = ~behind & ~away
    hidden = np.zeros(mesh.n_faces, dtype=bool)
    if facing.any():
        tree = TriangleTree.build(positions, mesh.faces)
        hidden[facing] = mostly_hidden(tree, np.flatnonzero(facing), seen_from)
    if mesh.polygon_of is not None:  # triangles that face the projector are hidden together
        n_hidden, n_facing = (np.bincount(mesh.polygon_of, faces) for faces in (hidden, facing))
        hidden = facing & (2.0 * n_hidden > n_facing)[mesh.polygon_of]
    if options.unseen == "aside":
        unseen = behind | away | hidden
        corners[unseen] = np.clip(corners[unseen], 0.0, 1.0) - (1.0, 0.0)
    counts = {
        "faces behind the projector": behind,
        "faces turned away": away,
        "faces hidden": hidden,
    }
    tallies = {name: int(found.sum()) for name, found in counts.items()}
    return Projected(corners=corners, tallies=tallies)


def projector_matrix(mesh: Mesh, options: UnwrapOptions, local: LocalFrame) -> FloatArray:
    """(4, 4) float64: takes local (x, y, z, 1) to (s, t, r, q); q is 1 if it is constant."""
    with np.errstate(over="ignore", invalid="ignore"):
        if options.matrix is None:
            # Seen from the center, so that no bit is lost where the model is far from the origin.
            rows, away = _camera_rows(mesh, options.camera, options.fov, local)
            matrix = np.column_stack([rows, pm.matmul(-rows, away)])
        else:
            matrix = np.array(whole_matrix(options.matrix), dtype=np.float64)
            matrix = np.column_stack(
                [matrix[:, :3] / local.scale, pm.matmul(matrix, [*local.center, 1.0])]
            )
        if not matrix[3, :3].any() and matrix[3, 3] != 0.0:
            matrix /= matrix[3, 3]
    if not np.isfinite(matrix).all():
        raise OptionError("matrix: it makes coordinates that are not finite")
    return matrix


def seen_from_of(matrix: FloatArray) -> FloatArray:
    """(4,): where rays come from, (x, y, z, 1) or (x, y, z, 0), the point with s = t = q = 0."""
    rows = matrix[[0, 1, 3]]
    lengths = np.abs(rows).max(axis=1)
    if not lengths.all():
        raise OptionError("matrix: one of its rows s, t and q is 0, so there is no image")
    rows = rows / lengths[:, None]
    rows /= pm.norm(rows, axis=1, keepdims=True)
    sizes, directions = pm.svd(rows)
    if sizes[2] < _DEPENDENT:
        raise OptionError("matrix: its rows s, t and q flatten the image to a line")
    point = directions[3]
    if abs(point[3]) > _AT_INFINITY:
        return np.asarray(point / point[3])
    # Seen from there, with s to the right and t upward, the image is not mirrored ...
    if pm.det(np.stack([*rows, point])) > 0.0:
        point = -point
    # ... but r decides if it changes along the rays.
    r, towards = matrix[2, :3], point[:3]
    r = r * unit_scale(float(np.abs(r).max()))  # no square is beyond float64
    if pm.matmul(r, towards) > _DEPENDENT * pm.norm(r):
        towards = -towards
    return np.array([*towards / pm.norm(towards), 0.0])


def _cast(
    positions: FloatArray, faces: IntArray, used: BoolArray, matrix: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return (F, 3, 2) float64 s / q and t / q, and (F,) bool faces with a corner behind."""
    x, y, z = positions.T
    # Term by term, so that equal positions give equal bits.
    s, t, q = (a * x + b * y + c * z + d for a, b, c, d in matrix[[0, 1, 3]])
    least = _LEAST_Q * (float(np.abs(q[used]).max()) or 1.0)
    behind = (q < least)[faces].any(axis=1)
    q = np.maximum(q, least)
    with np.errstate(over="ignore"):
        points = np.stack([s / q, t / q], axis=-1)
    if not np.isfinite(points[used]).all():
        raise OptionError("matrix: it makes coordinates that are not finite")
    return points[faces], behind


def _turned_to(positions: FloatArray, faces: IntArray, seen_from: FloatArray) -> BoolArray:
    """(F,) bool: faces whose front faces a point (x, y, z, 1) or a direction (x, y, z, 0)."""
    a, b, c = (positions[faces[:, corner]] for corner in range(3))
    towards = seen_from[:3] - seen_from[3] * a
    normals = np.cross(b - a, c - a)
    cosines = pm.vecdot(normals, towards)
    lengths = pm.norm(normals, axis=1) * pm.norm(towards, axis=1)
    return np.asarray(cosines > _ALONG * lengths)


def mostly_hidden(
    tree: TriangleTree,
    face_ids: npt.NDArray[np.integer[Any]],
    seen_from: FloatArray,
    *,
    threads: int | None = None,
) -> BoolArray:
    """(n,) bool: faces of which others, from any side, hide more than half of their four samples.

    `seen_from` (4,): a point (x, y, z, 1) or direction (x, y, z, 0). Kernel:
    `core/ray_occlusion.c`.
    """
    hidden = np.zeros(len(face_ids), dtype=bool)
    ids = np.ascontiguousarray(face_ids, dtype=np.int32)
    eye = np.ascontiguousarray(seen_from, dtype=np.float64)

    def work(start: int, stop: int) -> None:
        core.find_mostly_hidden(
            tree.positions, tree.faces, tree.order, tree.boxes, tree.nodes,
            ids, _SAMPLES, eye, start, stop, hidden,
        )  # fmt: skip

    run_bands(work, len(face_ids), band=_BAND, threads=threads)
    return hidden


def whole_matrix(rows: Sequence[Sequence[float]]) -> Matrix:
    """Return the four rows of a projector's matrix; with three rows s, t and q, r is q."""
    s, t, r, q = (
        (float(row[0]), float(row[1]), float(row[2]), float(row[3]))
        for row in (*rows[:3], rows[-1])
    )
    return s, t, r, q


def read_matrix(path: PathLike, *, projector: bool = True) -> Matrix:
    """Read sixteen numbers, row by row; of a projector also twelve, rows s, t and q."""
    lines = read_lines(path, "a matrix")
    n_words = sum(len(line.words) for line in lines)
    if n_words != 16 and not (projector and n_words == 12):
        others = ", or 12 without the row of r" if projector else ""
        raise FileFormatError(
            f"{path}: it has {counted(n_words, 'word')}; "
            f"a matrix needs 16 numbers{others}, row by row"
        )
    values = [v for line in lines for v in parse_row(path, line, len(line.words), "a matrix")]
    return whole_matrix([values[i : i + 4] for i in range(0, n_words, 4)])
