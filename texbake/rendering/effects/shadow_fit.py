"""Fitting the view of a light's shadow map to the casters and the visible receivers.

Directional lights use a parallel projection that covers the visible parts of receivers that casters
may shadow, spot lights a perspective one, point lights and very wide spots the six faces of a cube.
Bounding boxes decide which object may shadow which; a flat one never shadows itself.

Based on: Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978; Lauritzen, Salvi,
Lefohn, "Sample distribution shadow maps", I3D 2011, for the fit to what is seen.

Kernel: `core/shadow_maps.c`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import FloatArray
from texbake.parallel import run_bands
from texbake.rendering.camera import Camera
from texbake.rendering.effect import RenderState
from texbake.rendering.effects.lights import PlacedLight
from texbake.rendering.scene.lights import Light
from texbake.rendering.scene.scene import corners_of
from texbake.texture.cube_map import cube_face_axes

# A spot light wider than this angle in degrees uses a cube: in a single picture, texels at the rim
# would be four times as fine as at the center, or finer still.
WIDEST = 120.0
# Near plane relative to the distance of the farthest caster. Reversed depth keeps its precision.
_NEAR = 2.0**-20
# Four times the relative error of a distance computed from a float32 depth.
_DEPTH_ROUNDING = 2.0**-22
# A generous bound on the rounding when a flat box is transformed, relative to its coordinates.
_FLATNESS = 2.0**-44
_ROWS = 64
Box = FloatArray
Pair = tuple[int, int]


def box_of(state: RenderState, index: int) -> Box:
    """(8, 3): corners of the bounding box of an object as it is drawn."""
    if state.drawn(index).base_faces is None:
        return state.scene.objects[index].box_corners()
    points = state.drawn(index).positions
    return corners_of(np.stack([points.min(axis=0), points.max(axis=0)]))


def shading_pairs(
    light: PlacedLight, casters: Mapping[int, Box | None], receivers: Mapping[int, Box | None]
) -> list[Pair]:
    """List pairs (caster, receiver) that may shadow, by their boxes; unknown boxes (None) may."""
    return [
        (i, j)
        for i, caster in casters.items()
        for j, receiver in receivers.items()
        if caster is None or receiver is None or may_shade(light, caster, receiver)
    ]


def may_shade(light: PlacedLight, caster: Box, receiver: Box) -> bool:
    """Whether a caster's box may lie between a light and a receiver's box; conservative."""
    if _is_before(light, caster, receiver):
        return False
    (from_, near), (to, far) = _ball(caster), _ball(receiver)
    if light.kind == "directional":
        offset = to - from_
        along = float(pm.matmul(offset, light.direction))
        beside = math.sqrt(max(float(pm.matmul(offset, offset)) - along * along, 0.0))
        return beside <= near + far and along >= -(near + far)
    a, b = from_ - light.position, to - light.position
    length_a, length_b = float(pm.norm(a)), float(pm.norm(b))
    if light.kind == "spot" and length_b > far:
        half = pm.arccos(light.cosines[1]) + pm.arcsin(far / length_b)
        if _angle(b, light.direction) > half:
            return False
    if length_a <= near or length_b <= far:
        return True
    wide = pm.arcsin(near / length_a) + pm.arcsin(far / length_b)
    return _angle(a, b) <= wide and length_a - near <= length_b + far


def _is_before(light: PlacedLight, caster: Box, receiver: Box) -> bool:
    """Whether a caster is flat and the receiver lies in its plane or on the light's side of it."""
    edges = caster[[4, 2, 1]] - caster[0]
    lengths = pm.norm(edges, axis=1)
    thin = int(lengths.argmin())
    largest = max(float(np.abs(receiver).max()), float(np.abs(caster).max()))
    if lengths[thin] > _FLATNESS * largest:
        return False
    normal = np.cross(edges[(thin + 1) % 3], edges[(thin + 2) % 3])
    toward = -light.direction if light.kind == "directional" else light.position - caster[0]
    side = float(pm.matmul(normal, toward))
    if side == 0.0:  # seen edge-on, or a line
        return True
    heights = pm.matmul(receiver - caster[0], normal) * math.copysign(1.0, side)
    return bool(heights.min() >= -_FLATNESS * largest * float(pm.norm(normal)))


def _ball(corners: Box) -> tuple[FloatArray, float]:
    center = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    return center, float(pm.norm(corners - center, axis=1).max())


def _angle(a: FloatArray, b: FloatArray) -> float:
    return pm.arctan2(float(pm.norm(np.cross(a, b))), float(pm.matmul(a, b)))


def margin_of(size: int, radius: float) -> int:
    """Border of a shadow map in texels that only filtering needs."""
    return min(math.ceil(radius) + 1, (size - 1) // 2)


def perspective_views(light: Light, placed: PlacedLight, casters: Sequence[Box]) -> FloatArray:
    """(1 or 6, 4, 4): matrices from world to clip space for a spot or point light."""
    assert light.shadow is not None
    farthest = max(float(pm.norm(c - placed.position, axis=1).max()) for c in casters)
    near = _NEAR * farthest if farthest > 0.0 else 1.0
    size = light.shadow.size
    widened = size / (size - 2.0 * margin_of(size, light.shadow.filter_radius))
    if light.kind == "spot" and light.angle <= WIDEST:
        half, faces = math.radians(light.angle) / 2.0, [placed.axes]
    else:
        half, faces = math.radians(45.0), [cube_face_axes(face) for face in range(6)]
    fov = 2.0 * pm.arctan(widened * pm.tan(half))
    return np.stack(
        [
            Camera(eye=placed.position, axes=axes, fov=fov, near=near).clip_from_world(1.0)
            for axes in faces
        ]
    )


def parallel_view(
    light: Light, placed: PlacedLight, pairs: Sequence[tuple[Box, FloatArray]]
) -> tuple[FloatArray, tuple[int, int]] | None:
    """Matrix and size of a directional light's map of casters and seen receivers; None without."""
    assert light.shadow is not None
    shared, depths = [], []
    for caster, seen in pairs:
        along = pm.matmul(caster, placed.axes.T)
        low = np.maximum(seen[0], along.min(axis=0))[:2]
        high = np.minimum(seen[1], along.max(axis=0))[:2]
        far, near = float(seen[0, 2]), float(along[:, 2].max())
        if (low <= high).all() and near > far:
            shared.append((low, high))
            depths.append((far, near))
    if not shared:
        return None
    low, high = (np.array(ends) for ends in zip(*shared, strict=True))
    low, high = low.min(axis=0), high.max(axis=0)
    far, near = min(f for f, _ in depths), max(n for _, n in depths)
    size = light.shadow.size
    widest = float((high - low).max())
    if not widest > 0.0:
        widest = max(near - far, float(np.abs(low).max()) * 2.0**-40)
    margin = margin_of(size, light.shadow.filter_radius)
    texel = widest / (size - 2 * margin)
    # Whole texels, so that they are square; a fraction due to rounding falls into the margin.
    counts = np.ceil((high - low) / texel * (1.0 - 2.0**-40)).astype(int) + 2 * margin
    counts = np.clip(counts, 1, size)
    middle, half = 0.5 * (low + high), 0.5 * texel * counts
    depth = near - far
    in_axes = np.array(
        [
            [1.0 / half[0], 0.0, 0.0, -middle[0] / half[0]],
            [0.0, 1.0 / half[1], 0.0, -middle[1] / half[1]],
            [0.0, 0.0, 1.0 / depth, -far / depth],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    turn = np.eye(4)
    turn[:3, :3] = placed.axes
    return pm.matmul(in_axes, turn), (int(counts[1]), int(counts[0]))


def seen_bounds(
    state: RenderState, placed: PlacedLight, receivers: Sequence[int]
) -> dict[int, FloatArray]:
    """Bounds (2, 3) along a light's axes of the visible part of receivers, or of their box."""
    visibility = state.visible.visibility
    height, width = visibility.face_ids.shape
    receives = np.zeros(state.world.n_objects, np.bool_)
    receives[list(receivers)] = True
    bounds = np.empty((-(-height // _ROWS), len(receives), 2, 3))
    bounds[:, :, 0], bounds[:, :, 1] = np.inf, -np.inf
    rays = state.camera.view_rays(width, height)
    eye = np.ascontiguousarray(state.camera.eye, np.float64)

    def work(start: int, stop: int) -> None:
        core.find_seen_bounds(
            visibility.face_ids, visibility.depths, rays, eye, float(state.camera.near),
            state.world.starts, receives, placed.axes, _DEPTH_ROUNDING, start, stop,
            bounds[start // _ROWS],
        )  # fmt: skip

    run_bands(work, height, band=_ROWS, threads=state.threads)
    found = np.stack([bounds[:, :, 0].min(axis=0), bounds[:, :, 1].max(axis=0)], axis=1)
    for index in receivers:
        if state.plan.has("transparency", index):
            along = pm.matmul(box_of(state, index), placed.axes.T)
            found[index] = along.min(axis=0), along.max(axis=0)
    return {index: found[index] for index in receivers}
