"""Pictures projected onto surfaces: light cookies of spots, and projected textures.

The light cookie (gobo) of a spot, its `profile`, has the shape of its image and stands upright
along the light's `up`. It multiplies the light. In a rectangular gate its longer side fills the
angle of the light, and its border is that of the light; in a round gate its shorter side fills the
cone.
Projected textures are blended over the base color one after another, by their own opacity times
their strength. Nothing is projected behind a projector or outside the unit square of its picture.
With `facing`, a point gets the picture only if the projector and the camera are on the same side of
its triangle's plane, whichever way the triangle is wound. With `occlusion`, the scene is rasterized
from the projector, as for the shadow map of a light, and a point gets the share of the picture that
nothing hides. The projector stands where s, t and q are all 0; its clip space is (2s - q, 2t - q,
z, q) with a constant z, so that z/w falls with the distance.

A projector's matrix maps a point P in world space to s, t and q, each linear in P; the picture is
looked up at (s/q, t/q). From one pixel to the next P moves by dP in the plane of its triangle, and
by the quotient rule the coordinate changes by

    d(s/q) = (ds - (s/q) dq) / q

with ds and dq the linear parts applied to dP. dP follows from the plane as well: if P lies at t
times the ray r from the camera, the ray r + dr of the next pixel meets the plane with normal n at
P + t dr - t (n·dr) / (n·r) r, to first order.

Based on: Segal, Korobkin, van Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using
texture mapping", SIGGRAPH 1992. Unlike there, the derivatives are computed per point.

Kernel: `core/projected_pictures.c`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import Float32Array, FloatArray
from texbake.records import dataclass
from texbake.rendering.effect import Effect, Rejection, RenderState
from texbake.rendering.effects.images import LoadedImage, filtered_image, image_values, placed_image
from texbake.rendering.effects.lights import PlacedLight, cookie_extent, place_light, reaches_any
from texbake.rendering.effects.shadows import ShadowMap, render_shadow_map, shadowed_radiance
from texbake.rendering.fragments import Fragments, IncidentLight, one_row
from texbake.rendering.maps import colors_and_opacity_from, colors_from
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Deferred
from texbake.rendering.scene.lights import Light, Shadow
from texbake.rendering.scene.projected import ProjectedTexture, projector_matrix, projector_position
from texbake.rendering.scene.textures import FILTERS_WITH_FOOTPRINT, ImageTexture
from texbake.texture.image import FloatImage

_NO_STEPS = np.empty((0, 2, 3))


def load_cookie(
    texture: ImageTexture,
    pixels: FloatImage,
    *,
    filter_name: str,
    name: str,
    threads: int | None = None,
) -> LoadedImage:
    """Load a light cookie, with mip levels if its filter has a footprint."""
    image = placed_image(
        texture, pixels, kind="color", filter_name=filter_name, uvs=None, name=name
    )
    return filtered_image(image, threads=threads)


def pixel_steps(fragments: Fragments, state: RenderState) -> FloatArray:
    """(n, 2, 3): motion of points per pixel to the right and down; not finite if seen edge-on."""
    drawn = fragments.drawn
    steps = np.empty((len(fragments), 2, 3))
    core.find_pixel_steps(
        fragments.positions, drawn.positions, drawn.faces, fragments.drawn_faces, fragments.places,
        state.camera.view_rays(state.options.width, state.options.height),
        np.ascontiguousarray(state.camera.eye), steps,
    )  # fmt: skip
    return steps


@dataclass(frozen=True, eq=False)
class ProjectedPoints:
    """Places (n, 2) on a picture, their changes (n, 4) per pixel, and coverage (n,) by it."""

    places: FloatArray
    changes: Float32Array | None
    coverage: Float32Array

    def values(self, image: LoadedImage) -> Float32Array:
        """(n, C) float32: values of the picture; undefined where the coverage is 0."""
        return image_values(image, self.places, self.changes)


def project_onto(
    matrix: FloatArray, points: FloatArray, steps: FloatArray | None, filter_name: str
) -> ProjectedPoints:
    """Project world points (n, 3) by a (4, 4) matrix; coverage 0 behind the projector."""
    n = len(points)
    has_footprint = filter_name in FILTERS_WITH_FOOTPRINT
    places, coverage = np.empty((n, 2)), np.empty(n, np.float32)
    changes = np.zeros((n, 4), np.float32)
    core.project_points(
        points, steps if steps is not None and has_footprint else _NO_STEPS,
        np.ascontiguousarray(matrix, np.float64), places, changes, coverage,
    )  # fmt: skip
    return ProjectedPoints(places, changes if has_footprint else None, coverage)


def _cookie_reasons(request: RenderRequest, index: int) -> Iterator[str | Rejection]:
    light = request.light(index)
    if light.profile is None:
        return
    if light.kind != "spot":
        yield Rejection(f"only a spot holds a cookie, and it is {light.kind}")
    elif index not in request.shining:
        yield Rejection("it is dark")
    elif not request.lit:
        yield Rejection("no object in the picture is lit")
    else:
        yield "it has a light cookie"


def _load_light_cookie(state: RenderState, target: int) -> LoadedImage:
    light = state.lights[target]
    assert light.profile is not None
    return _image_of(light, state.request.filter_of(light.profile), state.threads)


def _image_of(light: Light, filter_name: str, threads: int | None) -> LoadedImage:
    assert light.profile is not None
    pixels = colors_from(light.profile.image, color=light.profile.color is not False)
    name = f"{light.name}.profile"
    return load_cookie(light.profile, pixels, filter_name=filter_name, name=name, threads=threads)


@dataclass(frozen=True, eq=False)
class LightCookie:
    """The picture in a spot light; `matrix` (4, 4) transforms world space to (s, t, r, q)."""

    image: LoadedImage
    matrix: FloatArray

    @classmethod
    def of(cls, light: Light, placed: PlacedLight) -> LightCookie:
        """Read the cookie of a placed spot light."""
        return cls(_image_of(light, "bilinear", None), cookie_matrix(light, placed))

    def colors(self, points: FloatArray) -> Float32Array:
        """(n, 3) float32: factor of the light at points."""
        found = project_onto(self.matrix, points, None, self.image.filter)
        return found.values(self.image) * found.coverage[:, None]


def cookie_matrix(light: Light, placed: PlacedLight) -> FloatArray:
    """(4, 4): transforms world space to (s, t, r, q) of a spot's cookie."""
    width, height = cookie_extent(light)
    # A square cookie has exactly the angle of the light.
    fov = light.angle if width == height else math.degrees(2.0 * pm.arctan(height))
    place, ahead = placed.position, placed.position + placed.direction
    return projector_matrix(
        position=(place[0], place[1], place[2]),
        target=(ahead[0], ahead[1], ahead[2]),
        up=tuple(placed.axes[1]),
        fov=fov,
        aspect=width / height,
    )


def _place_cookie(state: RenderState, target: int) -> FloatArray:
    return cookie_matrix(state.lights[target], state.of(place_light, target))


def _leave_out(
    fragments: Fragments, state: RenderState, index: int, incident: IncidentLight
) -> None:
    """Set a lamp's light to 0 if its cookie falls on no fragment, before drawing its shadow map."""
    profile = state.lights[index].profile
    assert profile is not None
    kind = state.request.filter_of(profile)
    steps = pixel_steps(fragments, state) if kind in FILTERS_WITH_FOOTPRINT else None
    matrix = state.of(_place_cookie, index)
    incident.on_cookie = project_onto(matrix, fragments.positions, steps, kind)
    covered = incident.radiance * incident.on_cookie.coverage[:, None]
    if not reaches_any(fragments, replace(incident, radiance=covered)):
        incident.radiance = covered


def _tint(fragments: Fragments, state: RenderState, index: int, incident: IncidentLight) -> None:
    found: ProjectedPoints = incident.on_cookie
    colors = found.values(state.of(_load_light_cookie, index)) * found.coverage[:, None]
    incident.radiance = incident.radiance * colors


LIGHT_PROFILES = Effect(
    name="light profiles",
    does="projects the light cookies of spots",
    after="lights",
    of="light",
    among="lights",
    reasons=_cookie_reasons,
    left_out="no light has a cookie",
    needs=("lights",),
    without=lambda scene: scene.with_lights(profile=None),
    load=_load_light_cookie,
    prepare=_place_cookie,
    dim=_leave_out,
    tint=_tint,
    deferred=True,
)


# Near plane relative to the depth of the farthest caster. Reversed depth keeps its precision.
_NEAR = 2.0**-20
# For each picture what its projector sees, None where nothing is in it to hide anything; None
# without `occlusion`.
ProjectorViews = list[Deferred[ShadowMap | None] | None]


def _projected_images(state: RenderState, target: int) -> list[Deferred[LoadedImage]]:
    return [
        Deferred(partial(_projected_image, state, target, i))
        for i in range(len(state.request.material(target).projected))
    ]


def _projected_image(state: RenderState, target: int, place: int) -> LoadedImage:
    texture = state.request.material(target).projected[place].texture
    with state.reporting_for(target):
        colors, opacity = colors_and_opacity_from(texture.image, color=texture.color is not False)
        if opacity is None:
            opacity = np.ones_like(colors[..., :1])
        factor = np.broadcast_to(np.asarray(texture.factor, np.float32), 3)
        # Premultiply before filtering, so that transparent texels do not bleed into opaque ones.
        picture = load_cookie(
            replace(texture, factor=1.0, border=(0.0,)),
            np.concatenate([colors * factor * opacity, opacity], axis=2),
            filter_name=state.request.filter_of(texture),
            name=f"projected[{place}].texture",
            threads=state.threads,
        )
    state.costs.add("projected textures", 0.0, picture.n_bytes)
    return picture


def _projector_views(state: RenderState, target: int) -> ProjectorViews:
    projected = state.request.material(target).projected
    return [
        Deferred(partial(_view_from, state, item)) if item.occlusion else None for item in projected
    ]


def _view_from(state: RenderState, item: ProjectedTexture) -> ShadowMap | None:
    """Rasterize the objects that cast shadows from the position of a projector."""
    matrix = item.world_matrix
    casters = [i for i, each in enumerate(state.scene.objects) if each.casts_shadows]
    depths = [pm.matmul(state.drawn(i).positions, matrix[3, :3]) + matrix[3, 3] for i in casters]
    farthest = max((float(depth.max()) for depth in depths if len(depth)), default=0.0)
    if not farthest > 0.0:
        return None
    s, t, q = matrix[0], matrix[1], matrix[3]
    clip = np.stack([2.0 * s - q, 2.0 * t - q, [0.0, 0.0, 0.0, _NEAR * farthest], q])
    shadow = Shadow()
    shape = (shadow.size, shadow.size)
    position = np.ascontiguousarray(projector_position(matrix))
    view = render_shadow_map(
        state, clip[None], shape, casters, radius=shadow.filter_radius, position=position
    )
    state.costs.add("projected textures", 0.0, view.n_bytes)
    return view


def _visibility_from(fragments: Fragments, state: RenderState, view: ShadowMap) -> Float32Array:
    """(n,) float32: share of the picture that reaches fragments."""
    assert view.position is not None
    offsets = view.position - fragments.positions
    lengths = pm.norm(offsets, axis=1, keepdims=True)
    toward: Float32Array = (offsets / np.where(lengths > 0.0, lengths, 1.0)).astype(np.float32)
    # The direction to the projector stands for the normal: facing is a question of its own.
    incident = IncidentLight(directions=toward, radiance=one_row((1.0, 1.0, 1.0), 3))
    found = shadowed_radiance(view, state.world, fragments, toward, incident)
    return np.ascontiguousarray(found[:, 0])


def _faces_projector(
    fragments: Fragments, state: RenderState, position: FloatArray
) -> Float32Array:
    """(n,) float32: 1 where the camera sees the side that faces a position, else 0."""
    drawn = fragments.drawn
    a, b, c = np.moveaxis(drawn.positions[drawn.faces[fragments.drawn_faces]], 1, 0)
    normals = np.cross(b - a, c - a)
    to_eye, to_projector = (pm.vecdot(normals, place - a) for place in (state.camera.eye, position))
    return np.asarray(to_eye * to_projector > 0.0, np.float32)


def _project(fragments: Fragments, state: RenderState) -> None:
    base = fragments.values.base_color
    pictures = state.of(_projected_images, fragments.target)
    projected = state.request.material(fragments.target).projected
    filters = [state.request.filter_of(item.texture) for item in projected]
    steps = None
    if any(name in FILTERS_WITH_FOOTPRINT for name in filters):
        steps = pixel_steps(fragments, state)
    views = state.of(_projector_views, fragments.target)
    for picture, item, view, name in zip(pictures, projected, views, filters, strict=True):
        matrix = item.world_matrix
        found = project_onto(matrix, fragments.positions, steps, name)
        coverage = found.coverage
        if item.facing:
            coverage *= _faces_projector(fragments, state, projector_position(matrix))
        seen = view.get() if view is not None and coverage.any() else None
        if seen is not None:
            coverage *= _visibility_from(fragments, state, seen)
        if not coverage.any():
            continue
        values = found.values(picture.get())
        share = (item.strength * coverage)[:, None]
        base = base * (1.0 - share * values[:, 3:]) + share * values[:, :3]
    fragments.slots = replace(fragments.values, base_color=np.ascontiguousarray(base, np.float32))


PROJECTED_TEXTURES = Effect(
    name="projected textures",
    does="projects pictures onto surfaces",
    after="slots",
    material_field="projected",
    why="a picture is projected onto it",
    left_out="nothing in the picture has a projected texture",
    needs=("slots", "positions"),
    load=_projected_images,
    prepare=_projector_views,
    shade=_project,
    rate="pixel",
)
