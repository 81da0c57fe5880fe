"""What formats have and `Mesh` has not: polygons, sRGB colors, far origins, images."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, MeshError, OptionError, UvError, warn_of
from texbake.files import PathLike, read_bytes, written_file
from texbake.mesh.mesh import (
    MAX_CORNERS,
    AnyArray,
    BoolArray,
    ByteArray,
    Float32Array,
    FloatArray,
    IntArray,
    Mesh,
)
from texbake.mesh.weld import weld_rows
from texbake.metadata import CONVENTION, SIGNATURE, SPACE, from_description, png_description


def strip_triangles(indices: AnyArray) -> AnyArray:
    """(F, 3) corners of triangle strips, wound alike; -1 in `indices` (n,) begins another strip.

    >>> strip_triangles(np.array([0, 1, 2, 3, -1, 4, 5, 6])).tolist()
    [[0, 1, 2], [1, 3, 2], [4, 5, 6]]
    """
    is_restart = indices == -1
    starts = np.maximum.accumulate(np.where(is_restart, np.arange(1, len(indices) + 1), 0))
    i = np.arange(max(len(indices) - 2, 0))
    i = i[~(is_restart[i] | is_restart[i + 1] | is_restart[i + 2])]
    odd = (i - starts[i]) % 2
    return np.asarray(indices[np.stack([i, i + 1 + odd, i + 2 - odd], axis=1)])


# Fields of `Mesh`: in words, and what replaces rows that are not finite.
_REPLACED = {
    "normals": ("normals", "computed ones replace them"),
    "uvs": ("texture coordinates", "(0, 0) replaces them"),
    "colors": ("vertex colors", "white replaces them"),
    "weights": ("weights of joints", "0 replaces them"),
    "morphs": ("displacements of morph targets", "0 replaces them"),
}


def check_corner_count(n_corners: int, path: PathLike) -> None:
    """Raise `FileFormatError` before nodes that share meshes make too many corners."""
    if n_corners > MAX_CORNERS:
        raise FileFormatError(
            f"{path}: it places more triangles than 32-bit indices can count; split it into "
            "several files"
        )


def finite_rows(path: PathLike, rows: AnyArray, field: str) -> AnyArray:
    """Replace rows (n, k) that are not finite with zeros, and warn with their number."""
    is_bad = rows_not_finite(rows)
    if not is_bad.any():
        return rows
    title, instead = _REPLACED[field]
    warn_of(path, f"{_count(is_bad)} {title} are not finite; {instead}")
    rows = rows.copy()
    rows[is_bad] = field == "colors"
    return rows


def finite_vertices(
    path: PathLike, positions: FloatArray, faces: IntArray, colors: AnyArray | None = None
) -> tuple[FloatArray, IntArray, AnyArray | None]:
    """Drop unused vertices that are not finite with a warning; `Mesh` refuses those in use."""
    is_bad = rows_not_finite(positions)
    if not is_bad.any() or faces.size == 0 or faces.min() < 0 or faces.max() >= len(positions):
        return positions, faces, colors
    if is_bad[faces].any():
        return positions, faces, colors
    warn_unused(path, f"{_count(is_bad)}")
    numbers = np.cumsum(~is_bad, dtype=np.int32) - np.int32(1)
    return positions[~is_bad], numbers[faces], None if colors is None else colors[~is_bad]


def warn_unused(path: PathLike, count: str) -> None:
    """Warn of unused vertices that are not finite; `count` is text such as `2 of 9`."""
    warn_of(path, f"{count} vertices are not finite; no face uses them, and they are left out")


def rows_not_finite(rows: AnyArray) -> BoolArray:
    """(n,) whether each row has a number that is not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(rows.sum()):  # a finite sum has only finite terms
            return np.zeros(len(rows), np.bool_)
    return np.asarray(~np.isfinite(rows).all(axis=1))


def _count(is_bad: BoolArray) -> str:
    return f"{np.count_nonzero(is_bad):,} of {len(is_bad):,}"


def unit_colors(path: PathLike, colors: FloatArray) -> Float32Array:
    """Linear colors of sRGB ones, up to 255 if all are whole and one is above 1; white for NaN."""
    known = colors[~rows_not_finite(colors)]
    if known.max(initial=0.0) > 1.0 and (known == np.round(known)).all():
        colors = colors / 255.0
    return linear_colors(finite_rows(path, colors, "colors"))


def linear_colors(colors: AnyArray) -> Float32Array:
    """Linear colors (V, 3), or (V, 4) with alpha, of sRGB ones: bytes, or numbers from 0 to 1."""
    if colors.dtype == np.uint8:
        levels = np.arange(256) / 255.0
        decoded = pm.decode_srgb(levels).astype(np.float32)[colors]
        decoded[:, 3:] = levels.astype(np.float32)[colors[:, 3:]]
        return decoded
    colors = np.clip(colors, 0.0, 1.0)
    return np.concatenate([pm.decode_srgb(colors[:, :3]), colors[:, 3:]], axis=1).astype(np.float32)


def srgb_colors(colors: Float32Array) -> FloatArray:
    """Colors (V, 3), or (V, 4) with alpha, float64, in sRGB, of linear ones."""
    return np.concatenate([pm.encode_srgb(colors[:, :3]), colors[:, 3:]], axis=1)


def srgb_bytes(colors: Float32Array) -> ByteArray:
    """Bytes (V, 3), or (V, 4) with alpha, in sRGB, nearest to linear colors."""
    codes = np.searchsorted(pm.decode_srgb((np.arange(255) + 0.5) / 255.0), colors)
    codes[:, 3:] = np.round(255.0 * np.clip(colors[:, 3:], 0.0, 1.0))
    return codes.astype(np.uint8)


# Distance from the origin, in diagonals, from which on float32 would lose more than 13 of its 24
# bits to it.
_FAR = 8192.0


def far_origin(mesh: Mesh) -> FloatArray:
    """(3,) place of a node, so that float32 holds positions about it; 0 for near meshes."""
    bounds = mesh.bounds
    if np.abs(bounds).max() <= _FAR * mesh.diagonal:
        return np.zeros(3)
    center: FloatArray = (0.5 * bounds).sum(axis=0)
    return center


# Rounding up to this share of the diagonal joins no vertices of a mesh worth the name.
_HARMLESS = 1e-7


def float32_positions(mesh: Mesh, origin: FloatArray) -> Float32Array:
    """Positions about an origin, as formats hold them."""
    exact = mesh.positions - origin
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        points = exact.astype(np.float32)
    if not np.isfinite(points).all():
        raise MeshError(f"{mesh.name}: a coordinate is beyond float32; scale it down first")
    if np.abs(points - exact).max(initial=0.0) <= _HARMLESS * mesh.diagonal:
        return points
    n_before, n_after = (len(np.unique(weld_rows(rows))) for rows in (exact, points))
    if 2 * n_after < n_before:
        raise MeshError(
            f"{mesh.name}: float32, which this format holds, would leave {n_after:,} of its "
            f"{n_before:,} vertices: it is {mesh.diagonal:.3g} model units across and up to "
            f"{np.abs(exact).max():.3g} from the origin; scale or move it first, or write a PLY or "
            "OBJ file"
        )
    return points


_MEDIA_TYPES = (
    (0, SIGNATURE, "image/png"),
    (0, b"\xff\xd8\xff", "image/jpeg"),
    (8, b"WEBP", "image/webp"),
    (0, b"\xabKTX 20\xbb\r\n\x1a\n", "image/ktx2"),
)


def media_type(data: bytes) -> str | None:
    """Media type of an image that glTF holds, by its first bytes; None for other formats.

    >>> media_type(b"BM6")
    """
    for start, signature, name in _MEDIA_TYPES:
        if data[start : start + len(signature)] == signature:
            return name
    return None


def image_file(path: PathLike) -> tuple[bytes, str]:
    """Bytes of a PNG or JPEG file, and its media type."""
    data = read_bytes(written_file(path))
    kind = media_type(data)
    if kind == "image/png":
        png_description(written_file(path))  # raises where it is damaged
        return data, kind
    if kind == "image/jpeg":
        return data, kind
    raise OptionError(f"{path}: the images of a material must be PNG or JPEG; save it as PNG")


def check_normal_map(path: PathLike) -> None:
    """Raise `OptionError` for a normal map that says it is not in tangent space with +Y."""
    _, kind = image_file(path)
    if kind != "image/png":
        return
    facts = from_description(png_description(written_file(path)))
    if facts.get(SPACE, "tangent") != "tangent":
        raise OptionError(
            f"{path}: it is in {facts[SPACE]} space; "
            "a material needs a map baked with `space` tangent"
        )
    if facts.get(CONVENTION, "opengl") != "opengl":
        raise OptionError(
            f"{path}: its green channel is {facts[CONVENTION]}; "
            "glTF and USD need a map baked with `convention` opengl"
        )


def require_uvs(mesh: Mesh) -> None:
    """Raise `UvError` for a mesh that cannot have a texture."""
    if mesh.uvs is None:
        raise UvError(
            f"{mesh.name}: it has no texture coordinates, which a texture needs; "
            f"make some with: texbake unwrap {mesh.name} -o OUT"
        )


def color_factors(base_color: Sequence[float]) -> list[float]:
    """Four factors of three or four; raise `OptionError` where they are none."""
    factors = [float(factor) for factor in base_color]
    if len(factors) not in (3, 4) or not all(0.0 <= factor <= 1.0 for factor in factors):
        raise OptionError(f"base_color: {factors} are not three or four factors between 0 and 1")
    return factors if len(factors) == 4 else [*factors, 1.0]


def as_text(name: str) -> str:
    """Return a name that UTF-8 can hold."""
    return name.encode("utf-8", "replace").decode("utf-8")
