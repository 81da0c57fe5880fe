"""What a person painted on a mesh, as numbers of its faces: in an image, or as vertex colors.

White is 1 and black 0, in sRGB as an image stores them; what is transparent counts as black.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from texbake.errors import FileFormatError, OptionError, UvError
from texbake.files import PathLike
from texbake.mesh.files.conversion import srgb_colors
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray, Int64Array, Mesh

COLORS = "colors"  # in place of an image: the vertex colors
_ROUNDING = 1e-6  # of float32 files, by which a coordinate may lie outside the unit square
_DIVISIONS = 4  # of each edge; the image is read in the middle of the triangles between them


def importance_at(source: PathLike, meshes: Sequence[Mesh]) -> list[FloatArray]:
    """(F,) numbers from 0 to 1 of each mesh, by an image over its coordinates, or vertex colors."""
    if str(source) != COLORS:
        return _painted(source, meshes, "importance")
    return [_by_colors(mesh) for mesh in meshes]


def _by_colors(mesh: Mesh) -> FloatArray:
    if mesh.colors is None:
        raise OptionError(
            f"importance: {mesh.name} has no vertex colors; paint some, or give an image"
        )
    grays = np.clip(_gray(srgb_colors(mesh.colors)), 0.0, 1.0)
    return np.asarray(grays[mesh.faces].mean(axis=1))


def protected_at(source: PathLike, meshes: Sequence[Mesh]) -> list[Int64Array]:
    """(n,) faces of each mesh that lie where those of a mesh file do, or that an image paints."""
    from texbake.mapping.marked_seams import faces_at
    from texbake.mesh.files import MESH_SUFFIXES, read_mesh

    named = meshes[0].name if len(meshes) == 1 else f"{len(meshes)} meshes"
    if Path(source).suffix.lower() in MESH_SUFFIXES:
        marked = read_mesh(source)
        found = [faces_at(marked, mesh) for mesh in meshes]
        why = f"none of its faces is a face of {named}; export the protected faces from the mesh, "
        why += "without moving them"
    else:
        found = [np.flatnonzero(gray > 0.5) for gray in _painted(source, meshes, "protect")]
        why = f"no face of {named} is more than half white; paint the protected faces white"
    if not any(map(len, found)):
        raise FileFormatError(f"{source}: {why}")
    return found


def _painted(path: PathLike, meshes: Sequence[Mesh], option: str) -> list[FloatArray]:
    """(F,) mean of an image over each face of each mesh, in its present coordinates."""
    from texbake.texture.image import read_header, read_image

    for mesh in meshes:
        if mesh.uvs is None:
            raise UvError(
                f"{mesh.name}: {option} with an image needs texture coordinates, and it has none; "
                "unwrap it first, and paint on that"
            )
        corners = mesh.corner_uvs()
        if not ((corners >= -_ROUNDING) & (corners <= 1.0 + _ROUNDING)).all():
            raise UvError(
                f"{mesh.name}: {option} with an image needs texture coordinates from 0 to 1, and "
                "some lie outside; move them into one tile first"
            )
    pixels = read_image(path, color=False).pixels.astype(np.float64)
    gray = _gray(pixels, by_alpha=not read_header(path).is_premultiplied)
    image = gray[..., None].astype(np.float32)
    found = [_face_means(image, mesh.corner_uvs()) for mesh in meshes]
    if not all(np.isfinite(means).all() for means in found):
        raise FileFormatError(
            f"{path}: {option}: some values are not finite; save the image without them"
        )
    return [np.clip(means, 0.0, 1.0) for means in found]


def _face_means(image: Float32Array, corners: FloatArray) -> FloatArray:
    """(F,) mean of a gray image over faces, by the coordinates of their corners (F, 3, 2)."""
    from texbake.texture.lookup import lookup

    points, sums = _centers(), np.zeros(len(corners))
    for weights in points:
        sums += lookup(image, (corners * weights[:, None]).sum(axis=1))[:, 0]
    return sums / len(points)


def _gray(values: FloatArray, *, by_alpha: bool = True) -> FloatArray:
    """Mean of the color channels, times the alpha where there is one and `by_alpha` is true."""
    n_colors = values.shape[-1] - (values.shape[-1] in (2, 4))
    gray: FloatArray = values[..., :n_colors].mean(axis=-1)
    return gray * values[..., -1] if by_alpha and n_colors < values.shape[-1] else gray


def _centers() -> FloatArray:
    """(n, 3) barycentric coordinates of the centers of the triangles that divide one evenly."""
    i, j, side = np.indices((_DIVISIONS, _DIVISIONS, 2)).reshape(3, -1)
    inside: BoolArray = i + j + side < _DIVISIONS
    x, y = ((each + (1 + side) / 3.0)[inside] / _DIVISIONS for each in (i, j))
    return np.stack([1.0 - x - y, x, y], axis=1)
