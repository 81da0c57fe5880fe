"""The view of a light's shadow map: which objects cast, which visible ones receive, what it covers.

A light looks at the scene as a camera does: a directional one along parallel lines, a spot in
perspective, a point light through the six faces of a cube, and so a spot too wide for one picture.
The view of a directional light is as large as what casters may cover of all that the picture shows
of receivers, and no larger. Which object may shade which is decided by their bounding boxes; a flat
one, such as a ground, shades nothing on its own side, and so not itself either.

Based on: Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978; Lauritzen, Salvi,
Lefohn, "Sample distribution shadow maps", I3D 2011, for the fit to what is seen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from texbake.mesh.mesh import FloatArray
from texbake.parallel import run_bands
from texbake.rendering.camera import Camera
from texbake.rendering.effect import RenderState
from texbake.rendering.effects.lights import PlacedLight
from texbake.rendering.kernels.projection import find_seen_bounds
from texbake.rendering.scene.lights import Light
from texbake.rendering.scene.scene import SceneObject
from texbake.texture.cube_map import cube_face_axes

# A spot wider than this, in degrees, looks through the faces of a cube: one picture of it would
# have texels at its rim four times as fine as in its middle, and ever more beyond.
WIDEST = 120.0

# The near plane in units of the farthest caster's distance. Reversed depth is as precise anywhere.
_NEAR = 2.0**-20

# Of a distance from the eye: what a float32 depth leaves uncertain, four times.
_DEPTH_ROUNDING = 2.0**-22

# Of the largest coordinate: what transforming a flat box leaves of its flatness, many times.
_FLATNESS = 2.0**-44

_ROWS = 64

Box = FloatArray

Pair = tuple[int, int]


def corners_of(item: SceneObject) -> Box:
    """(8, 3): corners of an object's bounding box in the world, before displacement."""
    corners = _corners(item.mesh.bounds)
    if item.transform is None:
        return corners
    return np.asarray(corners @ item.transform[:3, :3].T + item.transform[:3, 3])


def box_of(state: RenderState, index: int) -> Box:
    """(8, 3): corners of the bounding box of an object as it is drawn."""
    if state.drawn(index).base_faces is None:
        return corners_of(state.scene.objects[index])
    points = state.drawn(index).positions
    return _corners(np.stack([points.min(axis=0), points.max(axis=0)]))


def _corners(bounds: FloatArray) -> Box:
    """Corners in the order of their indices in binary, x first."""
    return np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(-1, 3)


def shading_pairs(
    light: PlacedLight, casters: Mapping[int, Box | None], receivers: Mapping[int, Box | None]
) -> list[Pair]:
    """Pairs of objects of which the first may shade the second, by their boxes.

    A box that is not known yet (None) may do anything.
    """
    return [
        (i, j)
        for i, caster in casters.items()
        for j, receiver in receivers.items()
        if caster is None or receiver is None or may_shade(light, caster, receiver)
    ]


def may_shade(light: PlacedLight, caster: Box, receiver: Box) -> bool:
    """Whether some of one box can lie between a light and some of another; may say yes wrongly.

    But for a flat caster, boxes count as the balls around them.
    """
    if _is_before(light, caster, receiver):
        return False
    (from_, near), (to, far) = _ball(caster), _ball(receiver)
    if light.kind == "directional":
        offset = to - from_
        along = float(offset @ light.direction)
        beside = math.sqrt(max(float(offset @ offset) - along * along, 0.0))
        return beside <= near + far and along >= -(near + far)
    a, b = from_ - light.position, to - light.position
    length_a, length_b = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    if light.kind == "spot" and length_b > far:
        half = math.acos(light.cosines[1]) + math.asin(far / length_b)
        if _angle(b, light.direction) > half:
            return False
    if length_a <= near or length_b <= far:
        return True
    wide = math.asin(near / length_a) + math.asin(far / length_b)
    return _angle(a, b) <= wide and length_a - near <= length_b + far


def _is_before(light: PlacedLight, caster: Box, receiver: Box) -> bool:
    """Whether a caster is flat, and a receiver lies in its plane or wholly on the light's side."""
    edges = caster[[4, 2, 1]] - caster[0]
    lengths = np.linalg.norm(edges, axis=1)
    thin = int(lengths.argmin())
    largest = max(float(np.abs(receiver).max()), float(np.abs(caster).max()))
    if lengths[thin] > _FLATNESS * largest:
        return False
    normal = np.cross(edges[(thin + 1) % 3], edges[(thin + 2) % 3])
    toward = -light.direction if light.kind == "directional" else light.position - caster[0]
    side = float(normal @ toward)
    if side == 0.0:  # seen edge-on, or a line
        return True
    heights = (receiver - caster[0]) @ normal * math.copysign(1.0, side)
    return bool(heights.min() >= -_FLATNESS * largest * float(np.linalg.norm(normal)))


def _ball(corners: Box) -> tuple[FloatArray, float]:
    center = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    return center, float(np.linalg.norm(corners - center, axis=1).max())


def _angle(a: FloatArray, b: FloatArray) -> float:
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


def margin_of(size: int, radius: float) -> int:
    """Texels at each border of a map that are there for filters alone."""
    return min(math.ceil(radius) + 1, (size - 1) // 2)


def perspective_views(light: Light, placed: PlacedLight, casters: Sequence[Box]) -> FloatArray:
    """(1 or 6, 4, 4): clip space from world space, of a spot or a point light."""
    assert light.shadow is not None
    farthest = max(float(np.linalg.norm(c - placed.position, axis=1).max()) for c in casters)
    near = _NEAR * farthest if farthest > 0.0 else 1.0
    size = light.shadow.size
    widened = size / (size - 2.0 * margin_of(size, light.shadow.filter_radius))
    if light.kind == "spot" and light.angle <= WIDEST:
        half, faces = math.radians(light.angle) / 2.0, [placed.axes]
    else:
        half, faces = math.radians(45.0), [cube_face_axes(face) for face in range(6)]
    fov = 2.0 * math.atan(widened * math.tan(half))
    return np.stack(
        [
            Camera(eye=placed.position, axes=axes, fov=fov, near=near).clip_from_world(1.0)
            for axes in faces
        ]
    )


def parallel_view(
    light: Light, placed: PlacedLight, pairs: Sequence[tuple[Box, FloatArray]]
) -> tuple[FloatArray, tuple[int, int]] | None:
    """View of a directional light, and rows and columns of its map.

    Parameters
    ----------
    pairs
        Box (8, 3) of what may cast, in the world, and bounds (2, 3), along the light's axes, of
        what is seen to receive.

    Returns
    -------
    tuple or None
        None where nothing that casts lies before anything that receives.
    """
    assert light.shadow is not None
    shared, depths = [], []
    for caster, seen in pairs:
        along = caster @ placed.axes.T
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
    # Whole texels, so that they are square; a part of one that is rounding lies in the margin.
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
    return in_axes @ turn, (int(counts[1]), int(counts[0]))


def seen_bounds(
    state: RenderState, placed: PlacedLight, receivers: Sequence[int]
) -> dict[int, FloatArray]:
    """(2, 3) for each of some objects: bounds, along a light's axes, of what the picture shows.

    Of objects that light goes through, which no sample keeps, the whole box. Least above greatest
    where nothing is seen.
    """
    visibility = state.visible.visibility
    height, width = visibility.face_ids.shape
    receives = np.zeros(state.world.n_objects, np.bool_)
    receives[list(receivers)] = True
    bounds = np.empty((-(-height // _ROWS), len(receives), 2, 3))
    bounds[:, :, 0], bounds[:, :, 1] = np.inf, -np.inf
    rays = state.camera.view_rays(width, height)
    eye = np.ascontiguousarray(state.camera.eye, np.float64)

    def work(start: int, stop: int) -> None:
        find_seen_bounds(
            visibility.face_ids, visibility.depths, rays, eye, float(state.camera.near),
            state.world.starts, receives, placed.axes, _DEPTH_ROUNDING, start, stop,
            bounds[start // _ROWS],
        )  # fmt: skip

    run_bands(work, height, band=_ROWS, threads=state.threads)
    found = np.stack([bounds[:, :, 0].min(axis=0), bounds[:, :, 1].max(axis=0)], axis=1)
    for index in receivers:
        if state.plan.has("transparency", index):
            along = box_of(state, index) @ placed.axes.T
            found[index] = along.min(axis=0), along.max(axis=0)
    return {index: found[index] for index in receivers}
