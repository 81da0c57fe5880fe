"""Mapping in texture order: each texel is carried to the surface, and from there to the screen.

The renderer maps in screen order: for each pixel it finds the place on the texture. This module
goes the other way, to show why. A texel at (s, t) lies in the triangle of the texture that contains
its center; the same weights give its place on the surface, and the camera its place on the screen.

With `texture` each texel is written at one pixel, and the nearest wins where several are. Pixels
that no texel hits are gaps, and those that several hit were written more than once. With
`texture-coverage` a texel is divided until its parts are smaller than a pixel. Each part counts
with its projected area in the pixel that it lies in, and a pixel shows the mean by area.

Only base colors are mapped, without light. A texel that several triangles use is carried to the one
with the lowest number.

Based on: Catmull, "A subdivision algorithm for computer display of curved surfaces", 1974;
Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989, sections 2.2 and 3.2.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray, Int64Array, IntArray
from texbake.records import dataclass
from texbake.rendering.effect import RenderState
from texbake.rendering.effects.images import image_of
from texbake.rendering.effects.points import textured_mesh
from texbake.rendering.rasterize import SHOW_BACK, World, rasterize, read_only
from texbake.rendering.resolve import Frame, TexelReport
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import Scene
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.encoding import decode_srgb

# Most parts of all texels together, and along one side of a texel.
_MAX_PARTS = 1 << 24
_MAX_SIDE = 32
# Parts of a texel per pixel, along one side.
_PER_PIXEL = 2.0
# Projected area in pixels that a texel counts with at least.
_SMALLEST = 1e-12
# A surface hides a texel if it is nearer by more than this share of the distance.
_BEHIND = 1e-3
_UNIT_SQUARE = np.array(
    [[2.0, 0.0, 0.0, -1.0], [0.0, 2.0, 0.0, -1.0], [0.0, 0.0, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0]]
)


def base_colors_alone(scene: Scene) -> Scene:
    """Return a scene without light, whose materials have nothing but their base color."""
    objects = tuple(
        replace(
            item,
            material=Material(
                name=item.material.name,
                shading="unlit",
                base_color=item.material.base_color,
                alpha_mode="opaque",
                double_sided=item.material.double_sided,
            ),
        )
        for item in scene.objects
    )
    return replace(scene, objects=objects)


def in_texture_order(frame: Frame, state: RenderState) -> Frame:
    """Return a picture whose textured objects are drawn again, texel by texel."""
    color = frame.color.reshape(-1, 4).copy()
    background = state.options.background
    shown = state.visible.visibility.face_ids.ravel()
    totals = np.zeros(6, np.int64)
    divides = state.options.mapping_order == "texture-coverage"
    for target in sorted(state.visible.objects):
        if not isinstance(state.request.material(target).base_color, ImageTexture):
            continue
        first, stop = state.world.starts[target : target + 2]
        covered = (shown >= first) & (shown < stop)
        texels = _project_texels(state, target)
        sums, weights, writes = (_by_parts if divides else _by_points)(state, target, texels)
        reached = covered & (weights > 0.0)
        color[covered] = 0.0
        if background is not None:
            color[covered] = (*decode_srgb(background), 1.0)
        color[reached, :3] = (sums[reached] / weights[reached, None]).astype(np.float32)
        color[reached, 3] = 1.0
        counts = covered, covered & ~reached, covered & (writes > 1)
        totals += (len(texels.faces), *texels.lost, *(int(each.sum()) for each in counts))
    report = TexelReport(*map(int, totals))
    return replace(frame, color=color.reshape(frame.color.shape), texels=report)


@dataclass(frozen=True, eq=False)
class Texels:
    """Texels that triangles use: their triangle, place on the texture and color.

    `clip_from_texture` (F, 4, 3) takes (s, t, 1) of a triangle to clip space. `along` (n, 2, 2) has
    the pixels to the right and up per texel along s and along t, and `slack` (n,) how much the
    depth changes within a pixel. `lost` counts hidden texels and those outside the picture.
    """

    faces: IntArray
    places: FloatArray
    colors: Float32Array
    clip_from_texture: FloatArray
    size: tuple[int, int]
    along: FloatArray
    slack: FloatArray
    lost: tuple[int, int] = (0, 0)


# Sums of colors by weight, the weights, and the number of texels, each by pixel.
Sums = tuple[FloatArray, FloatArray, Int64Array]


def _project_texels(state: RenderState, target: int) -> Texels:
    """Find the texels of an object's base color, and what takes them to the screen."""
    drawn = state.drawn(target)
    image = image_of(state, target, "base_color")
    corners = image.place(textured_mesh(state, target).corner_uvs(image.uv_set))
    flat = np.concatenate([corners, np.zeros((*corners.shape[:2], 1))], axis=2).reshape(-1, 3)
    world = World(
        read_only(flat, np.float64),
        read_only(np.arange(len(flat)).reshape(-1, 3), np.int32),
        np.array([0, len(corners)], np.int64),
    )
    width, height = image.chain.width, image.chain.height
    modes = np.full(1, SHOW_BACK, np.uint8)
    of_texels = rasterize(world, _UNIT_SQUARE, width, height, modes=modes, threads=state.threads)
    rows, columns = np.nonzero(of_texels.face_ids >= 0)
    faces = of_texels.face_ids[rows, columns]
    # (s, t, 1) of a point is the sum of those of the corners, weighted.
    on_texture = np.concatenate([corners, np.ones((*corners.shape[:2], 1))], axis=2)
    singular = np.abs(pm.det(on_texture)) <= 0.0
    on_texture[singular] = np.eye(3)
    weights = pm.inv(on_texture)  # (F, 3, 3): the row (s, t, 1) times this is the weights
    points = drawn.positions[drawn.faces]
    whole = np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=2)
    matrix = state.camera.clip_from_world(state.options.width / state.options.height)
    clip = pm.matmul(matrix, pm.matmul(whole.swapaxes(1, 2), weights.swapaxes(1, 2)))
    places = np.stack([(columns + 0.5) / width, 1.0 - (rows + 0.5) / height], axis=1)
    colors = image.chain.level(0)[rows, columns] * image.factor
    along, slack = _changes(state, clip[faces], places, (width, height))
    found = Texels(faces, places, colors, clip, (width, height), along, slack)
    pixels, _, visible = _on_screen(state, target, found, found.places)
    lost = int((~visible & (pixels >= 0)).sum()), int((pixels < 0).sum())
    return replace(found, lost=lost)


def _on_screen(
    state: RenderState, target: int, texels: Texels, places: FloatArray
) -> tuple[IntArray, FloatArray, BoolArray]:
    """Pixel of points of texels, -1 outside the picture; their depth; and whether they are seen."""
    width, height = state.options.width, state.options.height
    homogeneous = np.column_stack([places, np.ones(len(places))])
    clip = pm.matvec(texels.clip_from_texture[texels.faces], homogeneous)
    with np.errstate(all="ignore"):
        x, y, depth = (clip[:, :3] / clip[:, 3:]).T
    inside = (clip[:, 3] > 0.0) & (np.abs(x) < 1.0) & (np.abs(y) < 1.0) & (depth <= 1.0)
    columns = np.where(inside, (0.5 + 0.5 * x) * width, 0.0).astype(np.int64)
    rows = np.where(inside, (0.5 - 0.5 * y) * height, 0.0).astype(np.int64)
    pixels = np.where(inside, rows * width + columns, -1)
    buffer = state.visible.visibility
    own = texels.faces + state.world.starts[target]
    nearest, nearest_depths = buffer.face_ids.ravel()[pixels], buffer.depths.ravel()[pixels]
    # Depth grows toward the camera. The texel need not lie in the middle of its pixel.
    in_front = (nearest == own) | (depth + texels.slack >= nearest_depths * (1.0 - _BEHIND))
    return pixels, depth, inside & in_front & _faces_camera(state, target)[texels.faces]


def _faces_camera(state: RenderState, target: int) -> BoolArray:
    """(F,) bool: whether the camera may see a triangle of an object."""
    drawn = state.drawn(target)
    if state.visible.modes[target] == SHOW_BACK:
        return np.ones(len(drawn.faces), np.bool_)
    first, second, third = np.moveaxis(drawn.positions[drawn.faces], 1, 0)
    normals = np.cross(second - first, third - first)
    return np.asarray(pm.vecdot(normals, state.camera.eye - first) > 0.0)


def _by_points(state: RenderState, target: int, texels: Texels) -> Sums:
    """Write each texel at one pixel, the nearest last; a sum is then a single color."""
    pixels, depth, seen = _on_screen(state, target, texels, texels.places)
    order = np.flatnonzero(seen)[np.argsort(depth[seen], kind="stable")]
    n = state.options.width * state.options.height
    sums, weights = np.zeros((n, 3)), np.zeros(n)
    sums[pixels[order]] = texels.colors[order]
    weights[pixels[order]] = 1.0
    return sums, weights, np.bincount(pixels[order], minlength=n).astype(np.int64)


def _by_parts(state: RenderState, target: int, texels: Texels) -> Sums:
    """Divide texels into parts that count with their projected area."""
    n = state.options.width * state.options.height
    sums, weights, writes = np.zeros((n, 3)), np.zeros(n), np.zeros(n, np.int64)
    step = 1.0 / np.array(texels.size)
    area = np.maximum(np.abs(pm.det(texels.along)), _SMALLEST)
    longest = float(pm.norm(texels.along, axis=1).max(initial=0.0))
    side = math.ceil(_PER_PIXEL * min(longest, _MAX_SIDE))
    side = max(1, min(side, _MAX_SIDE, math.isqrt(_MAX_PARTS // max(len(area), 1))))
    last = np.full(len(area), -1, np.int64)
    for k in range(side * side):
        offset = (np.array(divmod(k, side)) + 0.5) / side - 0.5
        pixels, _, seen = _on_screen(state, target, texels, texels.places + offset * step)
        at = pixels[seen]
        weights += np.bincount(at, area[seen], n)
        for channel in range(3):
            sums[:, channel] += np.bincount(at, area[seen] * texels.colors[seen, channel], n)
        # A texel writes a pixel once, however many parts it has there one after another.
        new = seen & (pixels != last)
        writes += np.bincount(pixels[new], minlength=n)
        last = np.where(seen, pixels, last)
    return sums, weights, writes


def _changes(
    state: RenderState, rows: FloatArray, places: FloatArray, size: tuple[int, int]
) -> tuple[FloatArray, FloatArray]:
    """Return `along` and `slack` of `Texels`; 0 behind the camera and for what is seen edge-on."""
    clip = pm.matvec(rows, np.column_stack([places, np.ones(len(places))]))
    scales = np.array([state.options.width / 2.0, state.options.height / 2.0, 1.0])
    with np.errstate(all="ignore"):
        # The derivative of x / w along s is (x_s - (x / w) w_s) / w, as along t, for y and for z.
        along = rows[:, :3, :2] - (clip[:, :3] / clip[:, 3:])[..., None] * rows[:, 3:, :2]
        along = along / clip[:, 3, None, None] * scales[:, None] / np.array(size)
        along = np.where(np.isfinite(along) & (clip[:, 3] > 0.0)[:, None, None], along, 0.0)
        (a, b), (c, d) = along[:, 0].T, along[:, 1].T
        right, up = d, -c  # rows of the inverse, times the determinant
        depth_s, depth_t = along[:, 2].T
        slope = np.abs(depth_s * right + depth_t * up) + np.abs(-depth_s * b + depth_t * a)
        slack = slope / np.abs(a * d - b * c)
    return along[:, :2], np.where(np.isfinite(slack), slack, 0.0)
