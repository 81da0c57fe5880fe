"""Contrasts in texture space and of images: coverage, seams, codes, levels, heights."""

from __future__ import annotations

from typing import Any

import numpy as np
from catalog.contrast import Contrast, degrees_between, not_finite
from catalog.geometry import mesh_of

import texbake
from texbake import Mesh
from texbake.baking.texels import SampleGrid, rasterize_uv, snap_uvs
from texbake.mesh.shapes import plane, uv_sphere
from texbake.mesh.tangents import corner_tangents
from texbake.texture.encoding import decode_normals, encode_normals, quantize_unsigned
from texbake.texture.mipmaps import mip_chain
from texbake.texture.padding import push_pull
from texbake.texture.sample import sample_texture

SIZE = 64


def _turned_grid() -> Mesh:
    """Squares whose common edges run through many centers of texels: at 45 degrees."""
    mesh = plane(16, 16)
    uvs = mesh.uvs - 0.5
    turned = np.column_stack([uvs[:, 0] - uvs[:, 1], uvs[:, 0] + uvs[:, 1]]) + 0.5
    return mesh.replace(uvs=turned)


def _owned_twice_by_floats(mesh: Mesh) -> Any:
    """Centers on the inner side of all edges, or on them, of more faces than one."""
    x, y = np.meshgrid(*[(np.arange(SIZE) + 0.5) / SIZE] * 2)
    points = np.stack([x, y], axis=-1).astype(np.float32)
    counts = np.zeros((SIZE, SIZE), int)
    for a, b, c in mesh.corner_uvs().astype(np.float32):
        inside = np.ones((SIZE, SIZE), bool)
        for tail, head in ((a, b), (b, c), (c, a)):
            edge, to = head - tail, points - tail
            inside &= edge[0] * to[..., 1] - edge[1] * to[..., 0] >= 0.0
        counts += inside
    return np.count_nonzero(counts > 1)


def _owned_twice(mesh: Mesh) -> Any:
    grid = SampleGrid(SIZE, SIZE, 1)
    return rasterize_uv(snap_uvs(mesh, grid), grid)[1]


def _edge_coordinates() -> tuple[Any, Any]:
    image = np.random.default_rng(0).random((16, 16, 3)).astype(np.float32)
    u = np.array([1.0, -1e-20, 0.0, 0.5, -3.0, 1e9, np.nan, np.inf] * 512)
    return image, np.stack([u, np.full(len(u), 0.25)], axis=1)


def _columns_by_floor(data: tuple[Any, Any]) -> Any:
    image, uvs = data
    columns = (uvs[:, 0] - np.floor(uvs[:, 0])) * image.shape[1]
    # Read as C would: what is no column is some other memory.
    return np.where((columns >= 0) & (columns < image.shape[1]), columns, np.nan)


def _mirrored_strip() -> Mesh:
    strip = plane(64, 1)
    return strip.replace(uvs=np.column_stack([np.abs(strip.uvs[:, 0] - 0.5), strip.uvs[:, 1]]))


def _mean_tangents(mesh: Mesh) -> Any:
    """Tangents of faces, summed at each vertex and normalized."""
    points, uvs = mesh.positions[mesh.faces], mesh.corner_uvs()
    p1, p2 = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    d1, d2 = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    determinants = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    tangents = (p1 * d2[:, 1:] - p2 * d1[:, 1:]) / determinants[:, None]
    sums = np.zeros((mesh.n_vertices, 3))
    np.add.at(sums, mesh.faces, tangents[:, None])
    return (sums / np.linalg.norm(sums, axis=1, keepdims=True))[mesh.faces].reshape(-1, 3)


def _corner_tangents(mesh: Mesh) -> Any:
    return corner_tangents(mesh)[..., :3].reshape(-1, 3)


def _tangent_error(mesh: Mesh, tangents: Any) -> float:
    """Greatest angle to where u grows: to the left in the left half, to the right in the other."""
    left = mesh.positions[mesh.faces].mean(axis=1)[:, 0] < 0.5
    grows = np.where(left[:, None], [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0])
    return float(
        np.nan_to_num(degrees_between(tangents, np.repeat(grows, 3, axis=0)), nan=180).max()
    )


def _widest(_: Mesh, corners: Any) -> float:
    """Columns of the sphere that the widest face covers, beyond the one that it has."""
    return float(np.ptp(corners[..., 0], axis=1).max() * 32.0 - 1.0)


def _by_arctangent(mesh: Mesh) -> Any:
    x, y, z = mesh.positions.T
    s = np.arctan2(y, x) / (2.0 * np.pi) + 0.5
    return np.stack([s, np.arccos(-z) / np.pi], axis=1)[mesh.faces]


def _by_mapping(mesh: Mesh) -> Any:
    return texbake.unwrap(mesh, method="spherical", axis="z").corner_uvs()


ANGLE = 1e-6


def _about_a_pole() -> Mesh:
    """Points of a unit sphere, one of them 1e-6 from its pole."""
    angles = np.array([ANGLE, 0.5, 0.5, np.pi - 0.5])
    turns = np.array([0.3, 1.0, 2.5, -1.5])
    points = np.column_stack(
        [np.sin(angles) * np.cos(turns), np.sin(angles) * np.sin(turns), np.cos(angles)]
    )
    return mesh_of(points, [[0, 1, 2], [1, 2, 3]])


def _latitudes_by_arccos(mesh: Mesh) -> Any:
    points = mesh.positions
    return 1.0 - np.arccos(points[:, 2] / np.linalg.norm(points, axis=1)) / np.pi


def _latitudes(mesh: Mesh) -> Any:
    mapped = texbake.unwrap(mesh, method="spherical", axis="z", center=(0.0, 0.0, 0.0))
    latitudes = np.empty(mesh.n_vertices)
    latitudes[mesh.faces] = mapped.corner_uvs()[..., 1]
    return latitudes


def _pole_error(_: Mesh, latitudes: Any) -> float:
    return float(abs((1.0 - latitudes[0]) * np.pi / ANGLE - 1.0) * 100.0)


def _random_normals() -> Any:
    vectors = np.random.default_rng(0).normal(size=(256, 256, 3))
    vectors[..., 2] = np.abs(vectors[..., 2])
    return (vectors / np.linalg.norm(vectors, axis=2, keepdims=True)).astype(np.float32)


def _overshooting() -> Any:
    return np.linspace(-0.2, 1.2, 1 << 16).reshape(256, 256, 1).astype(np.float32)


def _code_error(values: Any, codes: Any) -> float:
    return float(np.abs(codes / 255.0 - np.clip(values, 0.0, 1.0)).max())


def _normals_by_squares(heights: Any) -> Any:
    slopes = np.gradient(heights, axis=1), np.gradient(heights, axis=0)
    normals = np.stack([-slopes[0], slopes[1], np.ones_like(heights)], axis=-1)
    return normals / np.sqrt((normals * normals).sum(axis=-1, keepdims=True))


def _steep() -> Any:
    return (np.random.default_rng(1).random((64, 64)) * 1e30).astype(np.float32)


def _with_nan() -> tuple[Any, Any]:
    values = np.random.default_rng(5).random((64, 64, 3)).astype(np.float32)
    values[::9, ::5] = np.nan
    return values, np.random.default_rng(6).random((64, 64)) < 0.3


def _mean_fill(data: tuple[Any, Any]) -> Any:
    """Fill with means of what is owned, level by level; what is not owned weighs 0."""
    values, mask = data
    weights = mask[..., None].astype(np.float32)
    levels = [(values * weights, weights)]
    while len(levels[-1][0]) > 1:
        v, w = (x[::2, ::2] + x[1::2, ::2] + x[::2, 1::2] + x[1::2, 1::2] for x in levels[-1])
        levels.append((v, w))
    fill = levels[-1][0] / levels[-1][1]
    for v, w in levels[-2::-1]:
        fill = np.where(w > 0.0, v / w, np.repeat(np.repeat(fill, 2, axis=0), 2, axis=1))
    return fill


def _nan_added(data: tuple[Any, Any], filled: Any) -> float:
    return float(np.count_nonzero(~np.isfinite(filled).all(axis=2) & ~data[1]))


def _odd_image() -> Any:
    return np.random.default_rng(8).random((61, 37, 3)).astype(np.float32)


def _last_of_blocks(image: Any) -> Any:
    """Means of 2 x 2 texels; the last row and column of an odd side are left out."""
    while max(image.shape[:2]) > 1:
        h, w = max(image.shape[0] // 2, 1), max(image.shape[1] // 2, 1)
        rows = image[: 2 * h].reshape(h, -1, *image.shape[1:]).mean(axis=1)
        image = rows[:, : 2 * w].reshape(h, w, -1, 3).mean(axis=2)
    return image[0, 0]


def _last_level(image: Any) -> Any:
    chain = mip_chain(image)
    return chain.level(len(chain.sizes) - 1)[0, 0]


def _mean_error(image: Any, mean: Any) -> float:
    return float(np.abs(mean - image.mean(axis=(0, 1), dtype=np.float64)).max())


def _noisy_normals() -> tuple[Any, Any]:
    """Normals of smooth hills with noise of one degree, and the hills."""
    y, x = np.mgrid[:128, :128] / 128.0 * 2.0 * np.pi
    hills = 4.0 * (np.sin(x) * np.cos(2.0 * y) + 0.5 * np.cos(3.0 * x + y))
    options = texbake.HeightToNormalOptions(scale=1.0, width=128.0)
    normals = texbake.height_to_normal(hills, options).astype(np.float64)
    normals += np.random.default_rng(9).normal(size=normals.shape) * np.radians(1.0)
    return normals / np.linalg.norm(normals, axis=2, keepdims=True), hills


def _summed(data: tuple[Any, Any]) -> Any:
    """Add slopes up down the first column, and then along each row."""
    normals = data[0]
    along, down = -normals[..., 0] / normals[..., 2], normals[..., 1] / normals[..., 2]
    heights = np.cumsum(along, axis=1) + np.cumsum(down[:, :1], axis=0)
    return heights - heights.mean()


def _integrated(data: tuple[Any, Any]) -> Any:
    return texbake.normal_to_height(data[0], texbake.NormalToHeightOptions(width=128.0)).heights


def _hill_error(data: tuple[Any, Any], heights: Any) -> float:
    hills = data[1] - data[1].mean()
    return float(np.sqrt(np.mean((heights - hills) ** 2)) / np.ptp(hills) * 100.0)


TEXTURE_CONTRASTS = (
    Contrast(name="edges through centers of texels",
             wrong="both faces own the texels",
             unit="texels owned twice", prepare=_turned_grid, naive=_owned_twice_by_floats,
             ours=_owned_twice, error=lambda _, n: float(n), bound=0.0, why="exact"),
    Contrast(name="coordinates of 1, -1e-20 and NaN",
             wrong="u - floor(u) is 1, the column after the last one",
             unit="reads outside the image", prepare=_edge_coordinates,
             naive=_columns_by_floor, ours=lambda data: sample_texture(*data,
                                                                              filter="nearest"),
             error=not_finite, bound=0.0, why="exact"),
    Contrast(name="mirrored halves that share vertices",
             wrong="the tangents of both sides cancel, or one side wins",
             unit="largest error of a tangent, in degrees",
             prepare=_mirrored_strip, naive=_mean_tangents, ours=_corner_tangents,
             error=_tangent_error, bound=1e-4, why="float32"),
    Contrast(name="faces over the ±π seam, and at poles",
             wrong="a vertex has only one angle",
             unit="columns under a face beyond the right number", prepare=lambda: uv_sphere(16, 32),
             naive=_by_arctangent, ours=_by_mapping, error=_widest, bound=1e-9,
             why="rounding of an angle"),
    Contrast(name="arccos at its end",
             wrong="the arc cosine keeps 8 digits 1e-6 from a pole, and 4 of them are wrong",
             unit="error of the angle to the pole, in percent", prepare=_about_a_pole,
             naive=_latitudes_by_arccos, ours=_latitudes, error=_pole_error, bound=1e-7,
             why="1 - t has 1e-16 of 3e-7 left, by the definition of t"),
    Contrast(name="8-bit normals",
             wrong="codes are truncated, not rounded",
             unit="largest angle, in degrees", prepare=_random_normals,
             naive=lambda n: decode_normals(((n + 1.0) / 2.0 * 255.0).astype(np.uint8)),
             ours=lambda n: decode_normals(encode_normals(n, bits=8)),
             error=lambda n, back: float(degrees_between(n, back).max()), bound=0.39,
             why="half a step in each of three components"),
    Contrast(name="values beyond white and black",
             wrong="codes wrap around",
             unit="largest error, as a share of the range", prepare=_overshooting,
             naive=lambda v: (v * 255.0 + 0.5).astype(np.int64).astype(np.uint8),
             ours=lambda v: quantize_unsigned(v, 8), error=_code_error, bound=0.5001 / 255.0,
             why="half a step"),
    Contrast(name="heights of 1e30",
             wrong="squares of slopes overflow float32",
             unit="normals that are NaN or 0", prepare=_steep, naive=_normals_by_squares,
             ours=texbake.height_to_normal,
             error=lambda _, n: float(np.count_nonzero(~(np.linalg.norm(n, axis=2) > 0.5))),
             bound=0.0, why="exact"),
    Contrast(name="NaN beside what is to be filled",
             wrong="0 times NaN is NaN, in every coarser level",
             unit="NaN texels that padding adds", prepare=_with_nan, naive=_mean_fill,
             ours=lambda data: push_pull(*data), error=_nan_added, bound=0.0, why="exact"),
    Contrast(name="mip levels of 61 x 37",
             wrong="the last row and column are left out",
             unit="error of the mean, as a share of white", prepare=_odd_image,
             naive=_last_of_blocks,
             ours=_last_level,
             error=_mean_error,
             bound=1e-6, why="float32 sums over six levels"),
    Contrast(name="heights of normals with 1° of noise",
             wrong="errors add up along the path",
             unit="RMS error, in percent of the range", prepare=_noisy_normals, naive=_summed,
             ours=_integrated, error=_hill_error, bound=1.0,
             why="least squares over all paths; measured, with a margin for other seeds"),
)  # fmt: skip
