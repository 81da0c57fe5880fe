"""The environment at infinite distance, as background and as image-based light.

Five effects: the environment as a cube map, the background picture, its irradiance for each normal,
its prefiltered levels for each roughness, and the light it casts on surfaces (diffuse for all, plus
specular for metallic-roughness).

Based on: Greene, "Environment mapping and other applications of world projections", 1986; Karis,
"Real Shading in Unreal Engine 4", 2013, for the split of the mirrored part in two.

Kernel: `core/surrounding_light.c`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import FloatArray
from texbake.parallel import run_bands
from texbake.rendering.effect import Call, Effect, Refusal, RenderState, only_when_needed
from texbake.rendering.effects.ambient import arriving_share
from texbake.rendering.effects.shading_models import head_on, normals_effect
from texbake.rendering.fragments import Floats, Fragments, one_row
from texbake.rendering.maps import colors_from
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Result, Target
from texbake.rendering.scene.lights import Environment
from texbake.rendering.simplified_material import reflects_environment, scatters
from texbake.rendering.studio import STUDIO_ROOM, studio_room
from texbake.texture.cube_lookup import from_latitude_longitude, sample_cube
from texbake.texture.cube_map import CubeChain, CubeMap
from texbake.texture.image import FloatImage
from texbake.texture.prefilter import irradiance, specular_levels, split_sum_table

# Prefiltered environment: width in texels of a face of its sharpest level, and number of levels.
_SPECULAR_SIZE = 256

_LEVELS = 6

# Rows of pixels per band.
_ROWS = 32


@dataclass(frozen=True, eq=False)
class PlacedEnvironment:
    """A cube map with the rotation from world space to its own."""

    chain: CubeChain
    turn: FloatArray

    @property
    def n_bytes(self) -> int:
        """Memory of its texels."""
        return self.chain.texels.nbytes

    def look(self, directions: Floats, levels: Floats | None = None) -> Floats:
        """(n, 3) float32: light from directions (n, 3) in world space."""
        turned = directions
        if not np.array_equal(self.turn, np.eye(3)):
            turned = pm.matmul(directions, self.turn.T.astype(np.float32))
        turned = np.ascontiguousarray(turned)
        kind = "bilinear" if levels is None else "trilinear"
        return sample_cube(self.chain, turned, levels, filter=kind, threads=1)


def turn_of(environment: Environment, up: str) -> FloatArray:
    """(3, 3): rotation from world directions to those of the environment's image (+y up)."""
    radians = math.radians(environment.rotate)
    sine, cosine = pm.sin(radians), pm.cos(radians)
    about_up = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
    if up == "y":
        return about_up
    from_z_up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    turned: FloatArray = pm.matmul(about_up, from_z_up)
    return turned


def _load(state: RenderState, target: Target) -> PlacedEnvironment:
    environment = state.scene.lighting.environment
    assert environment is not None
    cube = _cube(environment, state.threads)
    if environment.intensity != 1.0:
        cube = CubeMap(cube.faces * np.float32(environment.intensity))
    return PlacedEnvironment(CubeChain.of([cube]), turn_of(environment, state.options.up))


def _cube(environment: Environment, threads: int | None) -> CubeMap:
    if environment.faces:
        return CubeMap(np.stack([colors_from(face) for face in environment.faces]))
    if isinstance(environment.image, str) and environment.image == STUDIO_ROOM:
        return studio_room(environment.size)
    if environment.image is not None:
        pixels = colors_from(environment.image)
        size = min(environment.size, max(1, pixels.shape[1] // 4))
        return from_latitude_longitude(pixels, size=size, threads=threads)
    faces = np.empty((6, 1, 1, 3), np.float32)
    faces[...] = one_row(environment.color, 3)
    return CubeMap(faces)


def _background_called_for(request: RenderRequest) -> Iterator[Call | Refusal]:
    environment = request.scene.lighting.environment
    if environment is None:
        return
    if request.shows_buffer:
        yield Refusal("the scene", "a buffer is shown")
    elif request.scene.lighting.fog is not None and request.scene.lighting.fog.fades:
        yield Refusal("the scene", "its fog hides what lies infinitely far")
    elif not environment.background and request.depth == 0:  # mirrors show it all the same
        yield Refusal("the scene", "its environment is not shown as the background")
    else:
        yield Call(None, "the scene", "it has an environment")


def _background(state: RenderState, target: Target) -> FloatImage:
    """(H, W, 3): the environment at pixels not fully covered by a surface; 0 elsewhere."""
    height, width = state.options.height, state.options.width
    side = state.options.supersampling
    environment = state.of(ENVIRONMENT_MAP)
    rays = state.camera.view_rays(width, height).astype(np.float32)
    behind = np.zeros((height, width, 3), np.float32)
    face_ids = state.visible.visibility.face_ids

    def work(start: int, stop: int) -> None:
        samples = face_ids[start * side : stop * side].reshape(stop - start, side, width, side)
        rows, columns = np.nonzero((samples < 0).any(axis=(1, 3)))
        places = np.stack([columns, rows + start], axis=1).astype(np.float32) + np.float32(0.5)
        directions = rays[0] + pm.matmul(places, rays[1:])
        behind[rows + start, columns] = environment.look(directions)

    run_bands(work, height, band=_ROWS, threads=state.threads)
    return behind


def _lighting_called_for(request: RenderRequest) -> Iterator[Call]:
    environment = request.scene.lighting.environment
    if environment is not None and environment.lighting:
        for index in request.lit:
            if reflects_environment(request.material(index)):
                yield Call(index, request.name(index), "the environment lights the scene")


def _lighting_needs(request: RenderRequest, target: Target) -> Iterator[str]:
    assert target is not None
    yield from ("slots", normals_effect(request, target))
    if scatters(request.material(target)):
        yield "irradiance"
    if request.material(target).shading == "metallic-roughness":
        yield from ("view directions", "prefiltered environment")


def _load_irradiance(state: RenderState, target: Target) -> PlacedEnvironment:
    environment = state.of(ENVIRONMENT_MAP)
    diffuse = irradiance(environment.chain.level(0), threads=state.threads)
    return PlacedEnvironment(CubeChain.of([diffuse]), environment.turn)


def _load_levels(state: RenderState, target: Target) -> PlacedEnvironment:
    """Prefilter the environment; level i is for the roughness i / (levels - 1)."""
    environment = state.of(ENVIRONMENT_MAP)
    size = min(_SPECULAR_SIZE, environment.chain.size)
    chain = specular_levels(
        environment.chain.level(0), n_levels=_LEVELS, size=size, threads=state.threads
    )
    return PlacedEnvironment(chain, environment.turn)


_ZERO = np.zeros((1, 1), np.float32)

_NO_TABLE = np.zeros((1, 1, 2), np.float32)


def _or_zero(values: Floats | None) -> Floats:
    return _ZERO if values is None else values


def _light(fragments: Fragments, state: RenderState) -> None:
    values, normals, to_eye = fragments.values, fragments.normals, fragments.to_eye
    assert normals is not None
    diffuse = np.zeros_like(normals)
    if scatters(fragments.drawn.material):
        diffuse = state.of(IRRADIANCE_MAP).look(normals)
    mirrored, table = np.empty((0, 3), np.float32), _NO_TABLE
    if fragments.drawn.material.shading == "metallic-roughness":
        assert to_eye is not None
        directions = np.empty_like(normals)
        core.mirror_directions(normals, to_eye, directions)
        assert values.roughness is not None
        levels = np.broadcast_to(values.roughness[:, 0] * (_LEVELS - 1), len(normals))
        mirrored = state.of(PREFILTERED_MAP).look(
            directions, np.ascontiguousarray(levels, np.float32)
        )
        table = split_sum_table()
    core.reflect_environment(
        normals, normals if to_eye is None else to_eye, diffuse, mirrored, table,
        values.base_color, _or_zero(values.roughness), _or_zero(values.metalness),
        head_on(fragments.drawn.material.ior), arriving_share(fragments), fragments.light,
    )  # fmt: skip


ENVIRONMENT_MAP = Result(_load)

ENVIRONMENT = Effect(
    name="environment",
    does="makes a cube map of the environment",
    of="picture",
    called_for=only_when_needed,
    left_out="the scene has no environment, or nothing shows it",
    load=ENVIRONMENT_MAP,
)

BACKGROUND_PICTURE = Result(_background)

BACKGROUND = Effect(
    name="background",
    does="shows the environment behind surfaces",
    of="picture",
    called_for=_background_called_for,
    left_out="the scene has no environment",
    needs=lambda request, target: ("environment",),
    prepare=BACKGROUND_PICTURE,
    behind=lambda state: state.of(BACKGROUND_PICTURE),
)

IRRADIANCE_MAP = Result(_load_irradiance)

IRRADIANCE = Effect(
    name="irradiance",
    does="integrates the environment's light for each normal",
    of="picture",
    called_for=only_when_needed,
    left_out="no environment lights a visible surface that is not pure metal",
    needs=lambda request, target: ("environment",),
    load=IRRADIANCE_MAP,
)

PREFILTERED_MAP = Result(_load_levels)

PREFILTERED_ENVIRONMENT = Effect(
    name="prefiltered environment",
    does="blurs the environment for each roughness",
    of="picture",
    called_for=only_when_needed,
    left_out="no environment lights a metallic-roughness surface in the picture",
    needs=lambda request, target: ("environment",),
    load=PREFILTERED_MAP,
)

# Results of scenes with an environment in common that are the same in all of them.
OF_ENVIRONMENT = (ENVIRONMENT_MAP, IRRADIANCE_MAP, PREFILTERED_MAP)

ENVIRONMENT_LIGHT = Effect(
    name="environment light",
    does="adds the light of the environment",
    called_for=_lighting_called_for,
    left_out="no environment lights a surface in the picture",
    needs=_lighting_needs,
    shade=_light,
    rate="vertex",
)
